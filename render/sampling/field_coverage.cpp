// SPDX-License-Identifier: Apache-2.0
#include "render/sampling/field_coverage.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

#include "base/parallel.h"
#include "render/sampling/direction_visibility.h"

namespace raystage {
namespace {

using Eigen::Vector3d;

/// Accumulates the weights of cameras and their coverage of a ray.
struct Count {
  double sum = 0, squares = 0, nearest = std::numeric_limits<double>::infinity();

  void add(double weight, double distance) {
    if (!(weight > 0)) return;
    sum += weight;
    squares += weight * weight;
    nearest = std::min(nearest, distance);
  }
};

}  // namespace

void measure_view_coverage(const ViewRequest& request, const BlendingField& field,
                           const PointVisibility& visible, RenderedView& image) {
  image.cameras.assign(image.coverage.size(), 0.0F);
  image.nearest_ray.assign(image.coverage.size(), std::numeric_limits<float>::infinity());
  const VirtualCamera& view = request.view;
  const Rig& rig = *request.instant.rig;
  const ViewRays rays(view);
  const auto measure = [&](int x, int y, std::size_t at) {
    const auto ray = rays.through(x + 0.5, y + 0.5);
    if (!ray || !(image.rgba[at * 4 + 3] > 0)) return;
    const double inverse_depth = 1 / static_cast<double>(image.z[at]);
    const BlendingField::Tile& tile =
        field.tile(x / BlendingField::kTile, y / BlendingField::kTile);
    Count in_frame, in_sight;
    for (const BlendingField::TileCamera& chosen : tile.cameras) {
      const Rig::Camera& camera = rig.cameras[static_cast<std::size_t>(chosen.camera)];
      const Vector3d to_camera = camera.pose.position - view.pose.position;
      const Vector3d towards = *ray - to_camera * inverse_depth;
      Eigen::Vector2d pixel;
      const double weight =
          static_cast<double>(BlendingField::share(tile, chosen, x, y)) *
          direction_visibility(camera.model,
                               camera.pose.world_from_camera_rotation.transpose() * towards, pixel);
      if (!(weight > 0)) continue;
      const double distance = to_camera.cross(*ray).norm() / ray->norm();
      in_frame.add(weight, distance);
      in_sight.add(visible ? weight * visible(chosen.camera, towards, inverse_depth) : weight,
                   distance);
    }
    const Count& count = in_sight.sum > 0 ? in_sight : in_frame;
    if (!(count.squares > 0)) return;
    image.cameras[at] = static_cast<float>(count.sum * count.sum / count.squares);
    image.nearest_ray[at] = static_cast<float>(count.nearest);
  };
  raystage::parallel_for(0, view.height, [&](int y) {
    for (int x = 0; x < view.width; ++x) {
      measure(x, y,
              static_cast<std::size_t>(y) * static_cast<std::size_t>(view.width) +
                  static_cast<std::size_t>(x));
    }
  });
}

RenderedView transparent_view(const ViewRequest& request) {
  RenderedView image = empty_view(request.view);
  if (!request.measure_coverage) return image;
  image.cameras.assign(image.coverage.size(), 0);
  image.nearest_ray.assign(image.coverage.size(), std::numeric_limits<float>::infinity());
  return image;
}

}  // namespace raystage
