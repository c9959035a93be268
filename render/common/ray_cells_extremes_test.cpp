// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <sstream>
#include <string>

#include "render/common/ray_cells.h"
#include "testing/render/exact_geometry.h"
#include "testing/render/extremes.h"
#include "testing/render/geometry_generators.h"

namespace raystage::render {
namespace {

using testing::all_cameras;
using testing::between;
using testing::direction;
using testing::exact_ray;
using testing::exact_weights;
using testing::random_rig;
using testing::Real;
using testing::rotation;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

std::array<Eigen::Vector3d, 3> centres_of(const rig::Rig& rig, const std::array<int, 3>& cell) {
  std::array<Eigen::Vector3d, 3> centres;
  for (std::size_t i = 0; i < 3; ++i) {
    centres[i] = rig.cameras[std::max(0, cell[i])].pose.position;
  }
  return centres;
}

int count_of(const std::array<int, 3>& cell) {
  return static_cast<int>(std::count_if(cell.begin(), cell.end(), [](int c) { return c >= 0; }));
}

/// A ray of a view that is aimed at the inside of a cell, an edge or a camera, or outside the cell.
struct Shot {
  VirtualCamera view;
  double x = 0, y = 0;  ///< pixel position of the ray
};

Shot some_shot(const rig::Rig& rig, const rig::Topology& topology) {
  const rig::Topology::Cell cell =
      topology.cells[*rc::gen::inRange<std::size_t>(0, topology.cells.size())];
  const auto centres = centres_of(rig, cell);
  std::array<double, 3> share{between(0, 1), between(0, 1), between(0.01, 1)};
  const int kind = *rc::gen::inRange(0, 4);  // inside, on an edge, at a camera, outside
  if (kind > 0) share[0] = 0;
  if (kind == 2) share[1] = 0;
  if (kind == 3) share[1] = -3;
  for (std::size_t i = static_cast<std::size_t>(count_of(cell)); i < 3; ++i) share[i] = 0;
  if (share[0] + share[1] + share[2] == 0) share[0] = 1;  // no weight remains
  const double sum = share[0] + share[1] + share[2];
  Eigen::Vector3d target = centres[0];
  for (std::size_t i = 0; i < 3; ++i) target += share[i] / sum * (centres[i] - centres[0]);

  const double height =
      *rc::gen::element(0.0, 1e-12, -1e-12, 1e-3, 0.1, -0.1, 10.0, 1e3, 1e6, -1e6);
  const double slant = *rc::gen::element(0.0, 0.0, 0.7, 5.0);
  const Eigen::Vector3d aside = topology.normal.cross(direction());
  Shot shot;
  rig::Pose pose;
  pose.position = target + height * topology.normal + slant * std::abs(height) * aside;
  const Eigen::Vector3d towards = target - pose.position;
  pose.world_from_camera_rotation = rotation();
  if (towards.norm() > 1e-6 && *rc::gen::arbitrary<bool>()) {  // look approximately at the target
    pose.world_from_camera_rotation =
        Eigen::Quaterniond::FromTwoVectors(-Eigen::Vector3d::UnitZ(), towards).toRotationMatrix();
  }
  const double fov = *rc::gen::element(0.01, 1.0, 50.0, 120.0, 179.0) * std::numbers::pi / 180;
  const int width = *rc::gen::element(1, 40, 16384);
  shot.view = virtual_camera_with_fov(width, *rc::gen::element(1, 30), fov, pose);
  shot.x = between(0, width);
  shot.y = between(0, shot.view.height);
  const Eigen::Vector3d in_camera = pose.camera_from_world(target);
  if (-in_camera.z() > 1e-3 * in_camera.norm()) {  // the ray to the target, where it is a pixel
    const schemas::Intrinsics& k = shot.view.intrinsics;
    shot.x = k.cx - k.fx * in_camera.x() / in_camera.z();
    shot.y = k.cy + k.fy * in_camera.y() / in_camera.z();
  }
  return shot;
}

/// Returns a bound of a weight's rounding error in double: a few units in the last place of the
/// eye's distance, divided by the cell's width and the ray's slope. The edge tolerance is added.
double bound_of(const rig::Rig& rig, const RayCells::Cell& cell, const Eigen::Vector3d& up,
                const VirtualCamera& view, double x, double y) {
  if (cell.count == 1) return kEpsilon;
  const auto centres = centres_of(rig, cell.camera);
  const Eigen::Vector3d third = cell.count == 3 ? Eigen::Vector3d(centres[2] - centres[0]) : up;
  const Eigen::Vector3d normal = (centres[1] - centres[0]).cross(third);
  double distance = 0, longest = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(cell.count); ++i) {
    distance = std::max(distance, (centres[i] - view.pose.position).norm());
    for (std::size_t j = 0; j < i; ++j)
      longest = std::max(longest, (centres[i] - centres[j]).norm());
  }
  const double width = cell.count == 3 ? normal.norm() / longest : longest;
  const Eigen::Vector3d ray = world_ray_from_pixel(view) * Eigen::Vector3d(x, y, 1);
  const double slope = std::abs(normal.normalized().dot(ray.normalized()));
  // The rounding of the ray itself: its terms grow with the field of view and the distance from the
  // axis.
  const schemas::Intrinsics& k = view.intrinsics;
  const double reach = (1 + (std::abs(x) + k.cx) / k.fx + (std::abs(y) + k.cy) / k.fy) / ray.norm();
  return 3 * cell.edge_tolerance + 64 * kEpsilon * reach * (distance + longest) / width / slope;
}

TEST(RayCellsExtremes, WeightsAreThoseOf50Digits) {
  int crossed = 0;
  EXPECT_TRUE(rc::check("any array, eye, field of view and ray", [&] {
    const rig::Rig rig = random_rig();
    const rig::Topology topology = rig::make_topology(rig, all_cameras(rig));
    const Shot shot = some_shot(rig, topology);
    const RayCells cells(shot.view, rig, topology);
    const auto ray = exact_ray(shot.view, shot.x, shot.y);
    const auto truth_in = [&](const RayCells::Cell& cell) {
      return exact_weights(centres_of(rig, cell.camera), cell.count, topology.up,
                           shot.view.pose.position, ray);
    };
    const auto crossing = cells.locate(shot.x, shot.y);
    if (!crossing) {  // then no cell is crossed, except for rays along the array
      for (const RayCells::Cell& cell : cells.cells()) {
        const auto truth = truth_in(cell);
        if (!truth) continue;
        const double bound = bound_of(rig, cell, topology.up, shot.view, shot.x, shot.y);
        const Real least =
            std::min({(*truth)[0], (*truth)[1], cell.count == 3 ? (*truth)[2] : Real(1)});
        RC_ASSERT(static_cast<double>(least) < bound);
      }
      return;
    }
    ++crossed;
    const RayCells::Cell& cell = cells.cells()[crossing->cell];
    double sum = 0;
    for (const double weight : crossing->weight) {
      RC_ASSERT(weight >= 0 && weight <= 1);
      sum += weight;
    }
    RC_ASSERT(std::abs(sum - 1) < 1e-12);
    const double bound = bound_of(rig, cell, topology.up, shot.view, shot.x, shot.y);
    if (bound > 0.1) return;  // a ray along the array: its weights are undetermined
    const auto truth = truth_in(cell);
    RC_ASSERT(truth.has_value());
    for (std::size_t i = 0; i < 3; ++i) {
      const double error = std::abs(static_cast<double>((*truth)[i] - crossing->weight[i]));
      RC_LOG() << "error " << error << " bound " << bound << '\n';
      RC_ASSERT(error <= bound);
    }
    for (const double weight : cells.nearest(*crossing).weight)
      RC_ASSERT(weight == 0 || weight == 1);
  }));
  EXPECT_GT(crossed, 30);  // else nothing was tested
}

/// Returns how spans differ from each pixel's own crossing, or an empty text.
std::string what_is_wrong(const RayCells& cells, const VirtualCamera& view) {
  std::vector<int> scratch;
  std::vector<RayCells::Span> spans;
  std::ostringstream wrong;
  for (int y = 0; y < view.height; ++y) {
    cells.row_spans(y, view.width, scratch, spans);
    std::vector<int> by_span(static_cast<std::size_t>(view.width), -1);
    for (const RayCells::Span& span : spans) {
      const Eigen::Vector3d& total = cells.cells()[span.cell].total;
      const auto side = [&](int x) { return total.dot(Eigen::Vector3d(x + 0.5, y + 0.5, 1)); };
      if (!(side(span.begin) * side(span.end - 1) > 0)) wrong << "row " << y << " turns over; ";
      for (int x = span.begin; x < span.end; ++x) by_span[x] = span.cell;
    }
    for (int x = 0; x < view.width; ++x) {
      const auto crossing = cells.locate(x + 0.5, y + 0.5);
      const int own = crossing ? crossing->cell : -1, spanned = by_span[x];
      if (own != spanned) {
        wrong << x << ", " << y << " is in span " << spanned << ", not " << own << "; ";
      }
    }
  }
  return wrong.str();
}

TEST(RayCellsExtremes, SpansAgreeWithEveryPixelsOwnCrossing) {
  for (const testing::ExtremeView& extreme : testing::extremes()) {
    SCOPED_TRACE(extreme.name);
    const testing::SyntheticTake take = testing::make_extreme_array(extreme.array);
    schemas::RigDocument document;
    for (const schemas::CameraGeometry& camera : take.cameras)
      document.cameras.push_back({camera, {}});
    rig::Rig rig = rig::rig_from_document(document);
    for (rig::Rig::Camera& camera : rig.cameras) {
      camera.pose.position += Eigen::Vector3d(take.origin[0], take.origin[1], take.origin[2]);
    }
    const RayCells cells(extreme.view, rig, rig::make_topology(rig, all_cameras(rig)));
    EXPECT_EQ(what_is_wrong(cells, extreme.view), "");
  }
}

TEST(RayCellsExtremes, SpansAgreeForAnyView) {
  EXPECT_TRUE(rc::check("any array, eye and field of view", [] {
    const rig::Rig rig = random_rig();
    const rig::Topology topology = rig::make_topology(rig, all_cameras(rig));
    VirtualCamera view = some_shot(rig, topology).view;
    if (view.width > 1000) view.height = 2;
    RC_ASSERT(what_is_wrong(RayCells(view, rig, topology), view) == "");
  }));
}

}  // namespace
}  // namespace raystage::render
