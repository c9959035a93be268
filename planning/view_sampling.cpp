// SPDX-License-Identifier: Apache-2.0
// Computes how finely the cameras sampled what a view shows (thesis 5.3), from the derivative of
// the homography through the focal plane and the lens, and how far the images of neighbouring
// cameras lie apart (eq. 2.1). For cameras b metres apart, a point at depth z appears on the plane
// at depth f at places that are b |f - z| / z apart. Cost: 9 positions x cells.
#include "planning/view_sampling.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "planning/ideal_view.h"
#include "render/common/plane_projection.h"
#include "render/common/ray_cells.h"

namespace raystage::planning {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

std::optional<Vector2d> pixel_in(const rig::CameraModel& model,
                                 const Eigen::Matrix3d& ideal_from_pixel, const Vector2d& at) {
  const auto pixel = project_ideal(model, ideal_from_pixel * Vector3d(at.x(), at.y(), 1));
  return pixel && model.contains(*pixel) ? pixel : std::nullopt;
}

/// Returns the least stretch of the mapping from the view's pixels to a camera's, if the camera
/// sees the place.
std::optional<double> stretch_in(const rig::Rig::Camera& camera,
                                 const render::PlaneProjection& projection, const Vector2d& at) {
  const Eigen::Matrix3d ideal = projection.ideal_from_pixel(camera.pose);
  const auto pixel = [&](double x, double y) {
    return pixel_in(camera.model, ideal, at + Vector2d(x, y));
  };
  const auto left = pixel(-0.5, 0), right = pixel(0.5, 0), above = pixel(0, -0.5),
             below = pixel(0, 0.5);
  if (!left || !right || !above || !below) return std::nullopt;
  Eigen::Matrix2d source_from_view;
  source_from_view << *right - *left, *below - *above;
  const double stretch = source_from_view.jacobiSvd().singularValues()[1];
  return std::isfinite(stretch) ? std::optional(stretch) : std::nullopt;
}

}  // namespace

std::optional<double> least_source_pixels_per_pixel(const render::VirtualCamera& given,
                                                    const rig::Rig& rig,
                                                    const rig::Topology& topology,
                                                    const Eigen::Vector4d& plane) {
  const render::VirtualCamera view = ideal_view(given);
  const render::PlaneProjection projection(view, plane);
  if (!projection.at_infinity() && projection.distance() == 0) return std::nullopt;
  const render::RayCells cells(view, rig, topology);
  std::optional<double> least;
  constexpr int kPlaces = 3;
  for (int row = 0; row < kPlaces; ++row) {
    for (int column = 0; column < kPlaces; ++column) {
      // One pixel within the picture, where the differences are in it.
      const Vector2d at(1 + std::max(0, view.width - 2) * column / (kPlaces - 1.0),
                        1 + std::max(0, view.height - 2) * row / (kPlaces - 1.0));
      if (!(projection.depth(at.x(), at.y()) > 0)) continue;
      const auto crossing = cells.locate(at.x(), at.y());
      if (!crossing) continue;
      const render::RayCells::Cell& cell = cells.cells()[crossing->cell];
      // The nearest camera, or where it does not see the point, the one with the largest weight.
      auto weights = crossing->weight;
      const auto first = cells.nearest(*crossing).weight;
      weights[std::ranges::max_element(first) - first.begin()] = 2;
      double weight = 0;
      std::optional<double> nearest;
      for (int i = 0; i < cell.count; ++i) {
        if (weights[i] < weight) continue;
        const auto stretch = stretch_in(rig.cameras[cell.camera[i]], projection, at);
        if (!stretch) continue;
        nearest = stretch;
        weight = weights[i];
      }
      if (nearest) least = std::min(least.value_or(*nearest), *nearest);
    }
  }
  return least;
}

std::optional<double> ghosting_pixels(const render::VirtualCamera& given, const rig::Rig& rig,
                                      const Eigen::Vector4d& plane, double depth, double spacing) {
  const render::VirtualCamera view = ideal_view(given);
  const double x = view.width / 2.0, y = view.height / 2.0;
  const render::PlaneProjection projection(view, plane);
  const double focal_length = view.intrinsics.fx;
  if (projection.at_infinity()) return focal_length * spacing / depth;
  if (projection.distance() == 0) return std::nullopt;
  const double from_view = projection.depth(x, y);
  if (!(from_view > 0)) return std::nullopt;
  if (std::isinf(from_view)) return focal_length * spacing / depth;
  const Vector3d in_focus = render::point_at_depth(view, x, y, from_view);
  const double from_array = rig.depth_of(in_focus);
  if (!(from_array > 0)) return std::nullopt;
  const double apart = spacing * std::abs(from_array / depth - 1);
  return focal_length * apart / from_view;
}

}  // namespace raystage::planning
