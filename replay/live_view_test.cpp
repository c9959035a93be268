// SPDX-License-Identifier: Apache-2.0
#include "replay/live_view.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "replay/live/live_take.h"
#include "schemas/recording_document.h"
#include "store/archive.h"
#include "store/jpegxl/frame_packer.h"
#include "testing/render/synthetic_take.h"
#include "testing/test_folder.h"

namespace raystage::replay {
namespace {

constexpr Nanoseconds kFrameTime = 66'666'667;

class LiveTakeTest : public ::testing::Test {
 protected:
  /// Writes the documents of a take and begins its archives, as a recorder does.
  void SetUp() override {
    options_.cameras = testing::camera_grid(1, 2, 0.06, 48, 32);
    testing::write_synthetic_take(options_, folder());
    const store::Take take(folder());
    epoch_ = take.document().epoch_utc;
    for (int i = 0; i < 2; ++i) {
      const schemas::TakeDocument::Camera& camera =
          take.document().cameras[static_cast<std::size_t>(i)];
      const auto frame = take.archive(i).jpeg(0);
      jpeg_.assign(frame.begin(), frame.end());
      std::filesystem::remove(folder() / camera.archive);
      std::filesystem::remove(folder() / camera.journal);
      writers_.emplace_back(folder() / camera.archive, folder() / camera.journal,
                            store::ArchiveWriter::Description{camera.id, 48, 32, epoch_});
    }
    session_.started_utc = epoch_;
    write_session();
  }

  std::filesystem::path folder() const { return folder_.path() / "take"; }
  void write_session() const {
    std::filesystem::create_directories(folder() / "recording");
    schemas::RecordingDocument document;
    document.node = "a";
    document.sessions = {session_};
    write_recording(document, folder() / "recording/a.json");
  }
  void append(std::size_t camera, int frame) { writers_[camera].append(jpeg_, frame * kFrameTime); }

  testing::SyntheticTake options_;
  testing::TestFolder folder_;
  Nanoseconds epoch_ = 0;
  std::vector<std::byte> jpeg_;
  std::vector<store::ArchiveWriter> writers_;
  schemas::RecordingDocument::Session session_;
};

TEST_F(LiveTakeTest, ShowsTheNewestInstantThatAllCamerasHave) {
  LiveTake live(folder());
  live.update(epoch_);
  EXPECT_FALSE(live.newest());
  EXPECT_FALSE(live.status().age_s);
  for (int frame = 1; frame <= 30; ++frame) append(0, frame);
  for (int frame = 1; frame <= 29; ++frame) append(1, frame);
  live.update(epoch_ + 31 * kFrameTime);
  ASSERT_TRUE(live.newest());
  EXPECT_EQ(live.newest()->time_ns, 29 * kFrameTime);
  EXPECT_EQ(live.newest()->present(), 2);
  EXPECT_NEAR(*live.status().age_s, 2 * kFrameTime * 1e-9, 1e-9);
  EXPECT_NEAR(live.status().cameras[0].fps, 15, 0.01);
  EXPECT_NEAR(*live.status().cameras[0].age_s, kFrameTime * 1e-9, 1e-9);
  for (int camera = 0; camera < 2; ++camera) {
    const int frame = live.newest()->frame[static_cast<std::size_t>(camera)];
    const auto bytes = live.take().archive(camera).jpeg(frame);
    EXPECT_TRUE(std::ranges::equal(bytes, jpeg_));
  }
}

TEST_F(LiveTakeTest, DoesNotWaitForACameraThatStalls) {
  append(1, 1);
  for (int frame = 1; frame <= 60; ++frame) append(0, frame);
  LiveTake live(folder());
  live.update(epoch_ + 61 * kFrameTime);
  ASSERT_TRUE(live.newest());
  EXPECT_EQ(live.newest()->time_ns, 60 * kFrameTime);
  EXPECT_EQ(live.newest()->present(), 1);
  EXPECT_GT(*live.status().cameras[1].age_s, 3);
}

TEST_F(LiveTakeTest, CountsDroppedFrames) {
  append(0, 1);
  writers_[0].append_missing(store::FrameStatus::kDroppedRamFull, 2 * kFrameTime);
  writers_[0].append_missing(store::FrameStatus::kStartUp, 2 * kFrameTime);
  LiveTake live(folder());
  live.update(epoch_);
  EXPECT_EQ(live.status().cameras[0].dropped, 1);
  live.update(epoch_);
  EXPECT_EQ(live.status().cameras[0].dropped, 1);
}

TEST_F(LiveTakeTest, SaysWhenFramesAreHeldAndWhenItEnded) {
  session_.held = true;
  write_session();
  LiveTake live(folder());
  live.update(epoch_);
  EXPECT_TRUE(live.status().is_held);
  EXPECT_FALSE(live.status().has_ended);
  session_.stopped_utc = epoch_ + 1;
  write_session();
  live.update(epoch_);
  EXPECT_TRUE(live.status().has_ended);
  EXPECT_FALSE(live.status().is_held);
}

TEST_F(LiveTakeTest, RendersAViewOfTheNewestInstant) {
  append(0, 1);
  append(1, 1);
  LiveView view(folder());
  schemas::ViewerMessage request;
  request.type = schemas::ViewerMessage::Type::kLive;
  request.width = 60;
  request.height = 40;
  EXPECT_FALSE(view.picture(request, {}));
  EXPECT_TRUE(view.update().age_s);
  EXPECT_EQ(view.picture(request, {})->content, PictureContent::kView);
  request.mosaic = true;
  EXPECT_EQ(view.picture(request, {})->content, PictureContent::kLive);
}

TEST_F(LiveTakeTest, ShowsPackedFramesOfAContinuedTake) {
  testing::SyntheticTake larger = options_;
  larger.cameras = testing::camera_grid(1, 2, 0.06, 160, 120);
  const std::filesystem::path take = folder_.path() / "packed";
  testing::write_synthetic_take(larger, take);
  std::vector<std::byte> jpeg;
  for (int i = 0; i < 2; ++i) {
    const store::Take source(take);
    const schemas::TakeDocument::Camera& camera =
        source.document().cameras[static_cast<std::size_t>(i)];
    const auto frame = source.archive(i).jpeg(0);
    jpeg.assign(frame.begin(), frame.end());
    const store::FramePacker::Packed packed =
        store::FramePacker().pack(jpeg, {160, 120}, 7, camera.archive);
    ASSERT_EQ(packed.refusal, "");
    std::filesystem::remove(take / camera.archive);
    std::filesystem::remove(take / camera.journal);
    store::ArchiveWriter writer(take / camera.archive, take / camera.journal,
                                {camera.id, 160, 120, epoch_, store::FrameCodec::kPacked});
    writer.append(packed.bytes, kFrameTime);
    writer.close();
  }
  LiveTake live(take);
  for (int update = 0; update < 2; ++update) {
    live.update(epoch_);
    ASSERT_TRUE(live.newest());
    const int last = live.newest()->frame[1];
    EXPECT_TRUE(std::ranges::equal(live.take().archive(1).jpeg(last), jpeg));
    const Mosaic mosaic = make_mosaic({live.take(), *live.newest()}, 60, 40);
    EXPECT_FALSE(mosaic.cells[0].is_absent);
    EXPECT_FALSE(mosaic.cells[1].is_absent);
  }
}

TEST_F(LiveTakeTest, ADamagedFrameIsShownAsAbsent) {
  writers_[0].append(std::vector<std::byte>(100, std::byte{7}), kFrameTime);
  append(1, 1);
  LiveTake live(folder());
  live.update(epoch_);
  ASSERT_TRUE(live.newest());
  const Mosaic mosaic = make_mosaic({live.take(), *live.newest()}, 60, 40);
  EXPECT_TRUE(mosaic.cells[0].is_absent);
  EXPECT_FALSE(mosaic.cells[1].is_absent);
}

}  // namespace
}  // namespace raystage::replay
