// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "testing/render/test_sweep.h"

namespace raystage::render {
namespace {

using testing::PlaneSweep;

/// Returns, for a view of step_edge(), the share of pixels with a wrong depth: not that of their
/// side of the edge. Counts pixels at least `beside` pixels away from the edge.
double wrong_side(const RenderedView& image, const VirtualCamera& view, int beside) {
  const ViewRays rays(view);
  int wrong = 0, count = 0;
  for (int y = 4; y < view.height - 4; ++y) {
    for (int x = 4; x < view.width - 4; ++x) {
      const auto side = [&](double at) {
        return testing::hits_wall(view.pose.position, *rays.through(at, y + 0.5));
      };
      if (side(x + 0.5 - beside) != side(x + 0.5 + beside)) continue;
      const testing::Plane& plane = side(x + 0.5) ? testing::kFront : testing::kBack;
      const double depth = plane.distance(view.pose.position, *rays.through(x + 0.5, y + 0.5));
      const auto found = static_cast<double>(image.z[y * view.width + x]);
      wrong += std::abs(found / depth - 1) > 0.05;
      ++count;
    }
  }
  return static_cast<double>(wrong) / count;
}

TEST_F(PlaneSweep, KeepsTheTwoSidesOfAStepApart) {
  const store::Take take = write(step_edge());
  EXPECT_LT(wrong_side(render(take, testing::default_view()), testing::default_view(), 4), 0.02);
}

/// A dark wall in front of a bright one, with little texture: the penalty of a depth step is larger
/// than the difference of the matching costs.
TEST_F(PlaneSweep, LetsDepthJumpWhereLightDoes) {
  testing::SyntheticTake settings = step_edge();
  settings.scene = [](const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
    const bool wall = testing::hits_wall(from, direction);
    const testing::Plane& plane = wall ? testing::kFront : testing::kBack;
    const Eigen::Vector3d hit = from + plane.distance(from, direction) * direction;
    auto rgb = testing::texture(hit.x(), hit.y() + plane.c);
    for (double& c : rgb) c = (wall ? 0.02 : 0.5) + 0.3 * c;
    return rgb;
  };
  const store::Take take = write(settings);
  const auto wrong = [&](double edge_scale) {
    return wrong_side(render(take, testing::default_view(), {{"edge_scale", edge_scale}}),
                      testing::default_view(), 1);
  };
  EXPECT_LT(wrong(2), 0.02);
  EXPECT_GT(wrong(0), 0.05);
}

/// One of nine cameras sees another object, as if that were directly in front of its lens.
TEST_F(PlaneSweep, LeavesOutTheCameraThatSeesSomethingElse) {
  testing::SyntheticTake settings = slanted(3, 3);
  const auto scene = settings.scene;
  settings.scene = [scene](const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
    return from.norm() < 1e-9 ? std::array<double, 3>{1, 1, 1} : scene(from, direction);
  };
  const store::Take take = write(settings);
  const VirtualCamera view = testing::default_view();
  const auto errors = [&](double left_out) {
    return testing::measure_slanted_errors(
        render(
            take, view,
            {{"outlier_cameras", left_out}, {"cameras", 6.0}, {"aggregation", std::string("box")}}),
        view);
  };
  const testing::SlantedErrors all = errors(0), selected = errors(1);
  EXPECT_LT(selected.disparity, 0.75 * all.disparity);
  EXPECT_LT(selected.disparity, 0.2);
  EXPECT_LT(selected.colour, 0.2 * all.colour);  // its samples are not blended either
}

}  // namespace
}  // namespace raystage::render
