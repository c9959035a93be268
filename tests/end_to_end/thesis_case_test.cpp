// SPDX-License-Identifier: Apache-2.0
// What the thesis' prototype did (4.4): 64 cameras of 320x240, a moving view, from archives.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <numbers>

#include "compose/exr_file.h"
#include "render/view/synthetic_take.h"
#include "tests/end_to_end/run_command.h"

namespace raystage {
namespace {

using testing::CommandResult;
using testing::files_with;
using testing::run;
using testing::write_text;

constexpr int kFrames = 8, kSize = 512;

/// Largest difference of a frame from the painted plane that all cameras look at, 4 m away.
double error_of(const ExrImage& image, const Eigen::Vector3d& eye) {
  const VirtualCamera view = virtual_camera_with_fov(kSize, kSize, 40 * std::numbers::pi / 180, {});
  double worst = 0;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double across = (x + 0.5 - view.intrinsics.cx) / view.intrinsics.fx;
      const double down = (y + 0.5 - view.intrinsics.cy) / view.intrinsics.fy;
      const double depth = 4 + eye.z();
      const auto truth = testing::painted_plane(eye.x() + depth * across, eye.y() - depth * down);
      const auto at = static_cast<std::size_t>(y * kSize + x) * 4;
      EXPECT_GT(image.rgba[at + 3], 0.999F);
      for (std::size_t c = 0; c < 3; ++c) {
        worst = std::max(worst, std::abs(truth[c] - static_cast<double>(image.rgba[at + c])));
      }
    }
  }
  return worst;
}

class ThesisCase : public ::testing::TestWithParam<const char*> {};

TEST_P(ThesisCase, RendersAMovingViewOfItsArray) {
  const TestFolder folder;
  testing::SyntheticTake settings;
  settings.cameras = testing::camera_grid(8, 8, 0.06, 320, 240);
  settings.frames = kFrames;
  settings.jpeg = {90, JpegEncodeSettings::Chroma::k420, -1};
  write_synthetic_take(settings, folder.path() / "take");
  ASSERT_EQ(run("raystage sync '" + (folder.path() / "take").string() + "'").exit_code, 0);
  write_text(folder.path() / "shot.json",
             R"({"schema": "raystage/shot/1", "name": "s", "width": 512, "height": 512,
    "fps": 15, "first_frame": 1, "last_frame": 8, "camera": [
    {"frame": 1, "position": [-0.07, 0.02, 0.1], "orientation": [1, 0, 0, 0],
     "horizontal_fov_deg": 40},
    {"frame": 8, "position": [0.07, -0.04, 0.02], "orientation": [1, 0, 0, 0],
     "horizontal_fov_deg": 40}],
    "layers": [{"name": "lf", "take": "take", "method": ")" +
                 std::string(GetParam()) + R"(", "focal_plane": {"depth_m": 4}}]})");
  const CommandResult rendered = run("raystage render '" + (folder.path() / "shot.json").string() +
                                     "' -o '" + (folder.path() / "s.####.exr").string() + "'");
  ASSERT_EQ(rendered.exit_code, 0) << rendered.err;
  EXPECT_THAT(rendered.err, ::testing::HasSubstr("frames/s"));
  // The view asks for more than cameras of 320 pixels over 62 degrees have.
  EXPECT_THAT(rendered.err, ::testing::HasSubstr("more resolution than the light field has"));
  ASSERT_EQ(files_with(folder.path(), ".exr").size(), static_cast<std::size_t>(kFrames));
  EXPECT_LT(error_of(read_exr(folder.path() / "s.0001.exr"), {-0.07, 0.02, 0.1}), 0.04);
  EXPECT_LT(error_of(read_exr(folder.path() / "s.0008.exr"), {0.07, -0.04, 0.02}), 0.04);
}

INSTANTIATE_TEST_SUITE_P(Methods, ThesisCase, ::testing::Values("focal_plane", "slabs"));

}  // namespace
}  // namespace raystage
