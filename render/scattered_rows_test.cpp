// SPDX-License-Identifier: Apache-2.0
// Rows of cameras that scatter about their line, as real ones do: each method must see with them
// what it sees with the exact row.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>

#include "render/renderer.h"
#include "testing/render/extremes.h"
#include "testing/render/synthetic_take.h"

namespace raystage::render {
namespace {

constexpr double kSpacing = 0.06;  // metres

/// Returns a row whose extents perpendicular to it, vertical and in depth, add up to `extent` of
/// the spacing at most. The ends reach the vertical extent.
testing::SyntheticTake scattered_row(double extent, std::uint32_t seed) {
  testing::SyntheticTake take;
  take.cameras = testing::camera_grid(1, 5, kSpacing, 64, 48);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> within(-0.5, 0.5);
  for (std::size_t i = 0; i < take.cameras.size(); ++i) {
    auto& pose = take.cameras[i].world_from_camera;
    const double up = i == 1 ? 0.5 : i == 3 ? -0.5 : within(random);
    pose[7] += 0.8 * extent * kSpacing * up;
    pose[11] += 0.2 * extent * kSpacing * within(random);
  }
  return take;
}

RenderedView render_row(const testing::SyntheticTake& row, const std::string& method) {
  const testing::TestFolder folder;
  write_synthetic_take(row, folder.path() / "take");
  const store::Take take(folder.path() / "take");
  rig::Pose pose;
  pose.position = {0.013, 0.004, 0.03};
  const VirtualCamera view = virtual_camera_with_fov(48, 36, 0.8, pose);
  return LightFieldRenderer(take, {}).render(view, store::select_frames(take, 0, 1),
                                             {method, Eigen::Vector4d(0, 0, 1, 4), {}});
}

double mean_coverage(const RenderedView& view) {
  double sum = 0;
  for (const float coverage : view.coverage) sum += double{coverage};
  return sum / static_cast<double>(view.coverage.size());
}

class ScatteredRows : public ::testing::TestWithParam<const char*> {};

TEST_P(ScatteredRows, AreFiniteAndKeepTheCoverageOfTheExactRow) {
  const double of_exact = mean_coverage(render_row(scattered_row(0, 0), GetParam()));
  EXPECT_GT(of_exact, 0.95);
  std::uint32_t seed = 1;
  for (const double extent : {1e-9, 1e-6, 1e-4, 0.001, 0.01, 0.03, 0.06, 0.09, 0.12, 0.16, 0.2}) {
    SCOPED_TRACE(extent);
    const RenderedView view = render_row(scattered_row(extent, seed++), GetParam());
    for (const float value : view.rgba) ASSERT_TRUE(std::isfinite(value));
    for (const float value : view.coverage) ASSERT_TRUE(value >= 0 && value <= 1.00001F);
    if (extent >= 0.1) continue;  // triangles: an array of which the view may leave the borders
    EXPECT_NEAR(mean_coverage(view), of_exact, 0.01);
    const std::string method = GetParam();
    const bool uses_cells = method == "focal_plane" || method == "nearest" || method == "slabs";
    const bool says_so = std::ranges::any_of(view.notes, [](const std::string& note) {
      return note.find("the cameras are in a row") != std::string::npos;
    });
    if (method != "auto") {
      EXPECT_EQ(says_so, uses_cells);
    }
  }
}

TEST_P(ScatteredRows, ShowWhatTheExactRowShows) {
  const RenderedView exact = render_row(scattered_row(0, 0), GetParam());
  for (std::uint32_t seed = 1; seed <= 3; ++seed) {
    const RenderedView view = render_row(scattered_row(0.01, seed), GetParam());
    double squares = 0, largest = 0;
    for (std::size_t i = 0; i < view.rgba.size(); ++i) {
      const double error = std::abs(double{view.rgba[i]} - double{exact.rgba[i]});
      squares += error * error;
      largest = std::max(largest, error);
    }
    EXPECT_LT(std::sqrt(squares / static_cast<double>(view.rgba.size())), 0.005);
    EXPECT_LT(largest, 0.05);
  }
}

std::string name_of_method(const ::testing::TestParamInfo<const char*>& info) { return info.param; }

INSTANTIATE_TEST_SUITE_P(Methods, ScatteredRows,
                         ::testing::Values("focal_plane", "nearest", "aperture", "lumigraph",
                                           "slabs", "plane_sweep", "depth", "auto"),
                         name_of_method);

}  // namespace
}  // namespace raystage::render
