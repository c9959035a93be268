// SPDX-License-Identifier: Apache-2.0
// The disk works for the frames of a shot that come next.
#include <gtest/gtest.h>

#include "compose/sequence_test_data.h"

namespace raystage {
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
  SequenceReport run_with(int in_flight) {
    options_.frames_in_flight = in_flight;
    return run();
  }
};

constexpr int kFramesOfTake = kCameras * kTicks - 1;  // one was dropped

/// Frames that are decoded already are not asked for: those that count were not.
TEST_F(ReadAhead, AsksForAllFramesOfLaterViewsBeforeTheyAreDecoded) {
  const SequenceReport report = run_with(1);
  EXPECT_EQ(report.rendered, kTicks);
  EXPECT_EQ(report.frames_read_ahead, kFramesOfTake - kCameras);  // nothing comes before 101
}

TEST_F(ReadAhead, LooksAsFarAheadAsFramesAreInFlight) {
  // Of the last alone; who of its cameras is looked through the others may know in part.
  const int of_last = run_with(kTicks - 1).frames_read_ahead;
  EXPECT_GE(of_last, 1);
  EXPECT_LE(of_last, kCameras);
  EXPECT_EQ(run_with(kTicks).frames_read_ahead, 0);
}

TEST_F(ReadAhead, AsksForAnInstantOnce) {
  shot_.layers.front().speed = 0;
  // The second frame's, before the first has been decoded: the same.
  EXPECT_EQ(run_with(1).frames_read_ahead, kCameras);
}

TEST_F(ReadAhead, LeavesOutCamerasThatAShotDoesNotLookThrough) {
  shot_.layers.front().method = "nearest";
  shot_.layers.front().options = {};
  shot_.camera = {{101, {0.01, -0.01, 0}, {1, 0, 0, 0}, 20}};  // the first is
  const SequenceReport report = run_with(1);
  EXPECT_EQ(report.rendered, kTicks);
  // Before the first view nobody knows who will be looked through.
  EXPECT_EQ(report.frames_read_ahead, kCameras + (kTicks - 2));
}

TEST_F(ReadAhead, LeavesMemoryWithinWhatIsGranted) {
  constexpr int kLarge = 960, kHigh = 720;
  constexpr double kDecoded = 8.0 * kLarge * kHigh * kFramesOfTake;  // 127 MB, of which half fits
  testing::write_wall_take(folder_.path() / "large", kLarge, kHigh);
  shot_.layers.front().take = "large";
  options_.memory_bytes = 400'000'000;
  const SequenceReport plenty = run_with(1);
  EXPECT_NEAR(static_cast<double>(plenty.decoded_bytes_held), kDecoded, 0.01 * kDecoded);
  options_.memory_bytes = 72'000'000;
  const SequenceReport little = run_with(1);
  EXPECT_EQ(little.exit_code(), ExitCode::kSuccess);
  EXPECT_LE(little.decoded_bytes_held, options_.memory_bytes);
  EXPECT_GT(static_cast<double>(little.decoded_bytes_held), 0.4 * kDecoded);
  EXPECT_EQ(little.frames_read_ahead, kFramesOfTake - kCameras);
  EXPECT_EQ(little.pixels_decoded, plenty.pixels_decoded);  // nothing twice
}

}  // namespace
}  // namespace raystage
