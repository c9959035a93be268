// SPDX-License-Identifier: Apache-2.0
// Reading source frames of the next shot frames ahead.
#include <gtest/gtest.h>

#include "testing/compose/sequence_test_data.h"
#include "testing/compose/test_camera_key.h"

namespace raystage::compose {
namespace {

using testing::kCameras;
using testing::kTicks;

class ReadAhead : public testing::SequenceTest {
 protected:
  ReadAhead() {
    // Renders from every camera.
    shot_.layers.front().method = "aperture";
    shot_.layers.front().options = {{"radius", 1.0}};
    options_.existing = ExistingFiles::kOverwrite;
  }
  void look_through_the_first() {
    shot_.layers.front().method = "nearest";
    shot_.layers.front().options = {};
    shot_.camera.keys = {testing::camera_key(101, {0.01, -0.01, 0}, 20)};
  }
  SequenceReport run_with(int frames_in_flight) {
    options_.frames_in_flight = frames_in_flight;
    return run();
  }
};

constexpr int kFramesOfTake = kCameras * kTicks - 1;  // one was dropped

/// Frames that are already decoded are not requested.
TEST_F(ReadAhead, AsksForAllFramesOfLaterViewsBeforeTheyAreDecoded) {
  const SequenceReport report = run_with(1);
  EXPECT_EQ(report.rendered, kTicks);
  EXPECT_EQ(report.frames_read_ahead, kFramesOfTake - kCameras);  // none for the first frame, 101
}

TEST_F(ReadAhead, LooksAsFarAheadAsFramesAreInFlight) {
  // Only of the last frame; some of its cameras may be known from the others.
  const int of_last = run_with(kTicks - 1).frames_read_ahead;
  EXPECT_GE(of_last, 1);
  EXPECT_LE(of_last, kCameras);
  EXPECT_EQ(run_with(kTicks).frames_read_ahead, 0);
}

TEST_F(ReadAhead, AsksForNothingMoreOfAnInstantThatIsLookedAt) {
  shot_.layers.front().speed = 0;
  for (const int frames_in_flight : {1, 3})
    EXPECT_EQ(run_with(frames_in_flight).frames_read_ahead, 0);
}

TEST_F(ReadAhead, AsksForAnInstantOnce) {
  shot_.layers.front().speed = 0.33;  // three frames show one tick
  shot_.last_frame = 101 + 3 * kTicks - 2;
  for (const int frames_in_flight : {1, 3, 4}) {
    const SequenceReport report = run_with(frames_in_flight);
    EXPECT_EQ(report.rendered, 3 * kTicks - 1);
    EXPECT_GE(report.frames_read_ahead, 1);
    EXPECT_LE(report.frames_read_ahead, kFramesOfTake - kCameras);
  }
}

TEST_F(ReadAhead, LeavesOutFramesThatAreThereAlready) {
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run_with(1).frames_read_ahead, kFramesOfTake - kCameras);
  const SequenceReport again = run_with(1);
  EXPECT_EQ(again.skipped, kTicks);
  EXPECT_EQ(again.frames_read_ahead, 0);
}

/// A resumed sequence has no more data about its cameras than a new one.
TEST_F(ReadAhead, OfAShotTakenUpAgainAsksForCamerasThatItLooksThrough) {
  look_through_the_first();
  options_.existing = ExistingFiles::kSkip;
  run_with(1);
  for (const int frame : {103, 104, 105, 106}) std::filesystem::remove(file(frame));
  const SequenceReport report = run_with(1);
  EXPECT_EQ(report.skipped, kTicks - 4);
  EXPECT_EQ(report.frames_read_ahead, 3);  // the first frame, 103, is not read ahead
}

TEST_F(ReadAhead, LeavesOutCamerasThatAShotDoesNotLookThrough) {
  look_through_the_first();
  const SequenceReport report = run_with(1);
  EXPECT_EQ(report.rendered, kTicks);
  EXPECT_EQ(report.frames_read_ahead, kTicks - 1);
}

TEST_F(ReadAhead, LeavesMemoryWithinWhatIsGranted) {
  constexpr int kLarge = 960, kHigh = 720;
  constexpr double kDecoded = 8.0 * kLarge * kHigh * kFramesOfTake;  // 127 MB, of which half fits
  testing::write_wall_take(folder_.path() / "large", kLarge, kHigh);
  shot_.layers.front().take = "large";
  options_.memory_bytes = 400'000'000;
  const SequenceReport plenty = run_with(1);
  EXPECT_NEAR(static_cast<double>(plenty.decoded_bytes_cached), kDecoded, 0.01 * kDecoded);
  options_.memory_bytes = 72'000'000;
  const SequenceReport little = run_with(1);
  EXPECT_EQ(little.exit_code(), ExitCode::kSuccess);
  EXPECT_LE(little.decoded_bytes_cached, options_.memory_bytes);
  EXPECT_GT(static_cast<double>(little.decoded_bytes_cached), 0.4 * kDecoded);
  EXPECT_EQ(little.frames_read_ahead, kFramesOfTake - kCameras);
  EXPECT_EQ(little.pixels_decoded, plenty.pixels_decoded);  // no frame twice
}

}  // namespace
}  // namespace raystage::compose
