// SPDX-License-Identifier: Apache-2.0
#include "store/take_summary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "testing/store/take_test_data.h"
#include "testing/test_folder.h"

namespace raystage::store {
namespace {

using ::testing::HasSubstr;

// The check value of the thesis' section 2.2.
TEST(AliasFreeDistance, OfTheThesisArray) {
  const double focal_length_px = 160 / std::tan(31 * std::numbers::pi / 180);
  EXPECT_NEAR(min_alias_free_distance(0.06, focal_length_px), 7.99, 0.005);
}

TEST(ShutterSummary, HasTheRangesOfRollingShuttersOnly) {
  schemas::RigDocument document = testing::rig_document(3);
  EXPECT_TRUE(summarise_shutters(rig::rig_from_document(document)).is_global());
  document.cameras[1].geometry.line_time_us = -20;
  document.cameras[2].geometry.line_time_us = 50;
  document.cameras[2].geometry.height = 100;
  document.cameras[1].geometry.height = 200;
  const ShutterSummary some = summarise_shutters(rig::rig_from_document(document));
  EXPECT_EQ(some.cameras, 3);
  EXPECT_EQ(some.rolling, 2);
  EXPECT_EQ(some.min_line_time_us, -20);
  EXPECT_EQ(some.max_line_time_us, 50);
  EXPECT_DOUBLE_EQ(some.min_read_out_ms, 4);
  EXPECT_DOUBLE_EQ(some.max_read_out_ms, 5);
}

TEST(TakeSummary, SaysWhatIsThereAndWhatIsNot) {
  const testing::TestFolder folder;
  const auto path = folder.path() / "take";
  {
    TakeWriter writer(path, testing::take_document(3), testing::rig_document(3));
    for (int i = 0; i < 10; ++i) {
      writer.archive(0).append(testing::fake_jpeg(1), i * 50'000'000);
      if (i == 4) {
        writer.archive(1).append_missing(FrameStatus::kDroppedRamFull, i * 50'000'000);
      } else {
        writer.archive(1).append(testing::fake_jpeg(2), i * 50'000'000);
      }
    }
    writer.archive(2).append_missing(FrameStatus::kStartUp, 0);
    writer.commit();
  }
  TakeSummary summary = summarise_take(Take(path));
  EXPECT_TRUE(summary.is_readable());
  ASSERT_EQ(summary.cameras.size(), 3u);
  EXPECT_EQ(summary.cameras[0].frames, 10);
  EXPECT_EQ(summary.cameras[1].frames, 9);
  EXPECT_EQ(summary.cameras[1].by_status[static_cast<std::size_t>(FrameStatus::kDroppedRamFull)],
            1);
  EXPECT_EQ(summary.cameras[2].by_status[static_cast<std::size_t>(FrameStatus::kStartUp)], 1);
  EXPECT_EQ(summary.cameras[2].frames, 0);
  EXPECT_TRUE(summary.cameras[2].closed);
  EXPECT_FALSE(summary.cameras[0].restart_markers.has_value());  // no JPEG
  EXPECT_EQ(summary.frames(), 19u);
  EXPECT_NEAR(summary.fps, 20, 1e-6);
  EXPECT_EQ(summary.duration, 500'000'000);
  EXPECT_NEAR(summary.spacing, 0.06, 1e-12);
  EXPECT_NEAR(summary.min_alias_free_distance, 7.99, 0.005);
  EXPECT_GT(summary.bytes_on_disk, summary.archive_bytes);
  EXPECT_FALSE(summary.timeline.has_value());
  EXPECT_THAT(summary.timeline_error, HasSubstr("no timeline"));

  write_timeline(build_timeline(Take(path), 0, 0), path);
  summary = summarise_take(Take(path));
  ASSERT_TRUE(summary.timeline.has_value());
  EXPECT_EQ(summary.timeline->ticks, 10);
  EXPECT_EQ(summary.timeline->statistics.absent, (std::vector<int>{0, 1, 10}));
}

TEST(TakeSummary, OneBadArchiveDoesNotHideTheOthers) {
  const testing::TestFolder folder;
  const auto path = folder.path() / "take";
  testing::write_take(path, {{1, 2}, {1, 2}});
  std::filesystem::remove(path / "archive" / "c1.mkv");
  const TakeSummary summary = summarise_take(Take(path));
  EXPECT_FALSE(summary.is_readable());
  EXPECT_EQ(summary.cameras[0].frames, 2);
  EXPECT_THAT(summary.cameras[1].error, HasSubstr("c1.mkv"));
  EXPECT_FALSE(summary.timeline.has_value());
}

}  // namespace
}  // namespace raystage::store
