// SPDX-License-Identifier: Apache-2.0
// Compares what is computed of a view's sampling with edges in rendered views.
#include "planning/view_sampling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "planning/complete_topology.h"
#include "render/renderer.h"
#include "store/take.h"
#include "store/timeline.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_poses.h"
#include "testing/test_folder.h"

namespace raystage::planning::view_sampling_test {
namespace {

using Eigen::Vector3d;
using testing::kDegree;
using testing::make_pose;

constexpr double kDark = 0.1, kBright = 0.6, kSpacing = 0.06;

/// A wall at z = -depth, dark on the left of an edge through x = offset that leans by `slope`.
testing::SceneFunction edge_at(double depth, double offset, double slope) {
  return [=](const Vector3d& origin, const Vector3d& direction) -> std::array<double, 3> {
    const Vector3d point = origin + (-depth - origin.z()) / direction.z() * direction;
    const double value = point.x() + slope * point.y() < offset ? kDark : kBright;
    return {value, value, value};
  };
}

class EdgeTake {
 public:
  EdgeTake(int camera_width, const testing::SceneFunction& scene) {
    testing::SyntheticTake options;
    options.cameras = testing::camera_grid(2, 2, kSpacing, camera_width, camera_width * 3 / 4);
    options.scene = scene;
    options.samples = 4;
    options.jpeg.quality = 98;
    options.jpeg.chroma = store::JpegEncodeOptions::Chroma::k444;
    write_synthetic_take(options, folder_.path() / "take");
    take_.emplace(folder_.path() / "take");
    topology_ = complete_topology(take_->rig());
  }

  const rig::Rig& rig() const { return take_->rig(); }
  const rig::Topology& topology() const { return topology_; }

  /// Returns the share of the edge's contrast along the rows of a view, by the distance in pixels
  /// from the line x = `middle` + `lean` (y - height / 2), ascending.
  std::vector<std::pair<double, double>> profile(const render::VirtualCamera& view,
                                                 const Eigen::Vector4d& plane, double middle,
                                                 double lean) const {
    render::RendererOptions options;
    options.blend_space = store::BlendSpace::kLinear;
    options.max_supersampling = 1;
    const render::LightFieldRenderer renderer(*take_, options);
    const auto image = renderer.render(view, store::select_frames(*take_, 0, 30'000'000),
                                       {.method = "focal_plane", .focal_plane = plane});
    std::vector<std::pair<double, double>> profile;
    for (int y = view.height / 4; y < view.height * 3 / 4; ++y) {
      for (int x = 0; x < view.width; ++x) {
        const double distance = x + 0.5 - middle - lean * (y + 0.5 - view.height / 2.0);
        const double value = static_cast<double>(image.rgba[4 * image.index(x, y)]);
        profile.emplace_back(distance, (value - kDark) / (kBright - kDark));
      }
    }
    std::ranges::sort(profile);
    return profile;
  }

 private:
  testing::TestFolder folder_;
  std::optional<store::Take> take_;
  rig::Topology topology_;
};

/// Returns the distance at which the mean profile crosses a share of the contrast.
double crossing(const std::vector<std::pair<double, double>>& profile, double share, double reach) {
  constexpr double kBin = 0.1;
  const auto bins = static_cast<std::size_t>(2 * reach / kBin);
  std::vector<double> sums(bins, 0);
  std::vector<int> counts(bins, 0);
  for (const auto& [distance, value] : profile) {
    const double bin = (distance + reach) / kBin;
    if (!(bin >= 0 && bin < static_cast<double>(bins))) continue;
    sums[static_cast<std::size_t>(bin)] += value;
    ++counts[static_cast<std::size_t>(bin)];
  }
  double before = -reach, value_before = 0;
  for (std::size_t i = 0; i < bins; ++i) {
    if (counts[i] == 0) continue;
    const double at = -reach + (static_cast<double>(i) + 0.5) * kBin, value = sums[i] / counts[i];
    if (value >= share && value_before < share) {
      return before + (share - value_before) / (value - value_before) * (at - before);
    }
    before = at;
    value_before = value;
  }
  return std::nan("");
}

// A view midway between two columns of cameras blends two edges of the same weight: a step at a
// quarter of the contrast and one at three quarters.
TEST(ViewSampling, GhostingIsTheWidthOfDoubledEdges) {
  constexpr double kLean = 0.02;  // cameras above each other move leaning edges apart, too
  struct Case {
    double wall, plane, behind;
  };
  for (const auto& [wall, focus, behind] :
       {Case{2, 4, 0}, Case{4, 2.5, 0}, Case{3, 2.5, 0.1}, Case{2, 3, 0.05}, Case{6, 3, 0}}) {
    const EdgeTake take(640, edge_at(wall, 0, kLean));
    const render::VirtualCamera view =
        render::virtual_camera_with_fov(640, 480, 45 * kDegree, make_pose({0, 0, behind}, 0));
    const Eigen::Vector4d plane(0, 0, 1, focus);
    const auto computed = ghosting_pixels(view, take.rig(), plane, wall, kSpacing);
    ASSERT_TRUE(computed);
    // y points down in pictures.
    const auto profile = take.profile(view, plane, 320, kLean);
    const double measured = crossing(profile, 0.75, 60) - crossing(profile, 0.25, 60);
    EXPECT_NEAR(measured, *computed, 0.5) << "wall " << wall << ", plane " << focus;
  }
}

// The edge is as much wider as the view has more pixels than the cameras recorded.
TEST(ViewSampling, ResolutionIsThatOfASlantedEdge) {
  constexpr double kLean = 0.15, kDepth = 3;
  const Eigen::Vector4d plane(0, 0, 1, kDepth);
  const auto width_of = [&](const EdgeTake& take, const render::VirtualCamera& view) {
    const auto profile = take.profile(view, plane, view.width / 2.0, kLean);
    return crossing(profile, 0.8, 20) - crossing(profile, 0.2, 20);
  };
  const EdgeTake take(320, edge_at(kDepth, 0, kLean));
  const auto ratio_of = [&](const render::VirtualCamera& view) {
    return least_source_pixels_per_pixel(view, take.rig(), take.topology(), plane).value();
  };
  const auto view_of = [](int width, double fov_deg, double behind) {
    return render::virtual_camera_with_fov(width, width * 3 / 4, fov_deg * kDegree,
                                           make_pose({0.004, 0.003, behind}, 0));
  };
  // A view that is slightly finer than the cameras is the measure: one with their pixels would have
  // all of its samples at the same place between theirs.
  const render::VirtualCamera fine = view_of(320, 52, 0);
  ASSERT_NEAR(ratio_of(fine), 0.81, 0.01);
  const double one = ratio_of(fine) * width_of(take, fine);
  for (const auto& [pixels, fov, behind] :
       {std::tuple{480, 45.0, 0.0}, {640, 40.0, 0.0}, {960, 35.0, 0.0}, {640, 30.0, 0.03}}) {
    const render::VirtualCamera view = view_of(pixels, fov, behind);
    const double computed = ratio_of(view), measured = one / width_of(take, view);
    EXPECT_LT(computed, 0.8);
    EXPECT_NEAR(measured / computed, 1, 0.1) << pixels << " pixels, computed " << computed;
  }
}

}  // namespace
}  // namespace raystage::planning::view_sampling_test
