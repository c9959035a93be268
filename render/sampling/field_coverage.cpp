// SPDX-License-Identifier: Apache-2.0
// Measures the cameras behind each visible pixel of a view that blends the cameras of a
// BlendingField, in double. Adds the cameras of the pixel's tile by weight times visibility of the
// pixel's point (RayCoverage). Input: alpha and z (metres) of the view. Output: effective number of
// cameras, and distance of the nearest one from the ray, metres. Cost: O(pixels x cameras of a
// tile).
#include "render/sampling/field_coverage.h"

#include "base/parallel.h"
#include "render/common/ray_coverage.h"
#include "render/sampling/direction_visibility.h"

namespace raystage::render {

using Eigen::Vector3d;

void measure_view_coverage(const ViewRequest& request, const BlendingField& field,
                           const PointVisibility& visible, RenderedView& image) {
  clear_coverage_measures(image);
  const VirtualCamera& view = request.view;
  const rig::Rig& rig = *request.instant.rig;
  const ViewRays rays(view);
  const auto measure = [&](int x, int y, std::size_t at) {
    const auto ray = rays.through(x + 0.5, y + 0.5);
    if (!ray || !(image.rgba[at * 4 + 3] > 0)) return;
    const double inverse_depth = 1 / static_cast<double>(image.z[at]);
    const BlendingField::Tile& tile = field.tile_at(x, y);
    RayCoverage in_frame, in_sight;
    for (const BlendingField::TileCamera& chosen : tile.cameras) {
      const rig::Rig::Camera& camera = rig.cameras[chosen.camera];
      const Vector3d to_camera = camera.pose.position - view.pose.position;
      const Vector3d towards = *ray - to_camera * inverse_depth;
      Eigen::Vector2d pixel;
      const double weight =
          static_cast<double>(BlendingField::share(tile, chosen, x, y)) *
          direction_visibility(camera.model,
                               camera.pose.world_from_camera_rotation.transpose() * towards, pixel);
      if (!(weight > 0)) continue;
      in_frame.add(weight, *ray, to_camera);
      in_sight.add(visible ? weight * visible(chosen.camera, towards, inverse_depth) : weight, *ray,
                   to_camera);
    }
    const RayCoverage& coverage = in_sight.cameras() > 0 ? in_sight : in_frame;
    image.cameras[at] = coverage.cameras();
    image.nearest_ray[at] = coverage.nearest_ray();
  };
  raystage::parallel_for(0, view.height, [&](int y) {
    for (int x = 0; x < view.width; ++x) measure(x, y, image.index(x, y));
  });
}

RenderedView transparent_view(const ViewRequest& request) {
  RenderedView image = empty_view(request.view);
  if (request.measure_coverage) clear_coverage_measures(image);
  return image;
}

}  // namespace raystage::render
