// SPDX-License-Identifier: Apache-2.0
#include "store/unsynced_timeline.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "testing/store/take_test_data.h"
#include "testing/test_folder.h"

namespace raystage::store {
namespace {

using ::testing::HasSubstr;

class UnsyncedTake : public ::testing::Test {
 protected:
  /// Writes a take with a frame of each camera at each of its times, ms.
  Take write(const std::vector<std::vector<int>>& times_ms) {
    const auto path = folder_.path() / "take";
    std::filesystem::remove_all(path);
    const auto cameras = static_cast<int>(times_ms.size());
    TakeWriter writer(path, testing::take_document(cameras), testing::rig_document(cameras));
    for (int camera = 0; camera < cameras; ++camera) {
      for (const int time : times_ms[camera]) {
        writer.archive(camera).append(testing::fake_jpeg(camera), time * 1'000'000LL);
      }
    }
    writer.commit();
    return Take(path);
  }
  testing::TestFolder folder_;
};

TEST_F(UnsyncedTake, AnInstantHasOneTickWithAllOfItsFrames) {
  const Timeline timeline = read_timeline(write({{7}, {90'000}, {12}, {}}));
  ASSERT_EQ(timeline.ticks.size(), 1U);
  EXPECT_GT(timeline.fps, 0);
  const FrameSelection& tick = timeline.ticks.front();
  EXPECT_EQ(tick.time_ns, (7 + 90'000) * 500'000LL);
  EXPECT_THAT(tick.frame, ::testing::ElementsAre(0, 0, 0, -1));
  EXPECT_EQ(tick.difference[1], (90'000 - 7) * 500'000LL);
}

TEST_F(UnsyncedTake, EqualTimeStampsAreTheTicks) {
  const Timeline timeline = read_timeline(write({{0, 40, 80, 120}, {0, 40, 80, 120}}));
  EXPECT_NEAR(timeline.fps, 25, 1e-9);
  ASSERT_EQ(timeline.ticks.size(), 4U);
  for (int i = 0; i < 4; ++i) {
    EXPECT_THAT(timeline.ticks[i].frame, ::testing::ElementsAre(i, i));
    EXPECT_NEAR(static_cast<double>(timeline.ticks[i].time_ns), 40e6 * i, 1);
  }
}

TEST_F(UnsyncedTake, OthersNeedSync) {
  for (const auto& times : {std::vector<std::vector<int>>{{0, 40, 80}, {0, 41, 80}},
                            {{0, 40, 80}, {0, 40}},
                            {{0, 40, 300, 301, 302}, {0, 40, 300, 301, 302}},  // no constant rate
                            {{}, {}}}) {
    try {
      read_timeline(write(times));
      FAIL() << "a timeline was made";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("raystage sync"));
    }
  }
}

}  // namespace
}  // namespace raystage::store
