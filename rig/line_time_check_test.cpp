// SPDX-License-Identifier: Apache-2.0
#include "rig/line_time_check.h"

#include <gtest/gtest.h>

namespace raystage::rig {
namespace {

/// Cameras of 1000 rows.
Rig rig_of(const std::vector<double>& line_times_us) {
  schemas::RigDocument document;
  for (const double line_time_us : line_times_us) {
    schemas::CameraGeometry camera;
    camera.id = "c" + std::to_string(document.cameras.size());
    camera.width = 1500;
    camera.height = 1000;
    camera.intrinsics = {1000, 1000, 750, 500, {}};
    camera.world_from_camera = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    camera.line_time_us = line_time_us;
    document.cameras.push_back({camera, {}});
  }
  return rig_from_document(document);
}

std::string text_of(const std::optional<Error>& error) { return error ? error->what() : ""; }

TEST(LineTimeCheck, ReadOutsAreAtMostAFrameTime) {
  // At 50 Hz a row takes at most 20 us.
  EXPECT_EQ(text_of(line_time_error(rig_of({0, 15, -20}), {}, 50, "rig.json")), "");
  EXPECT_EQ(
      text_of(line_time_error(rig_of({0, 15, -21, 15000}), {}, 50, "rig.json")),
      "rig.json: camera c2: with the line time of -21 us, 1000 rows take 21 ms, longer than a "
      "frame time of 20 ms. Correct line_time_us: microseconds from a row to the row below.");
}

TEST(LineTimeCheck, CamerasHaveTheirOwnPeriods) {
  const std::vector<double> periods_ns{0, 40e6};
  EXPECT_FALSE(line_time_error(rig_of({15, 39}), periods_ns, 50, ""));
  EXPECT_TRUE(line_time_error(rig_of({25, 39}), periods_ns, 50, ""));
  EXPECT_TRUE(line_time_error(rig_of({15, 41}), periods_ns, 50, ""));
  EXPECT_FALSE(line_time_error(rig_of({25, 39}), periods_ns, 0, ""));  // of no known rate
}

}  // namespace
}  // namespace raystage::rig
