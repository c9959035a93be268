// SPDX-License-Identifier: Apache-2.0
// Reference of focal_plane.cpp (thesis 4.1.2), per ray in double. A pixel is a sum over the corners
// of the cell that the ray crosses: corner weight x visibility x the camera's sample. Each sample
// is taken where the ray meets the plane. Output: R, G, B, A, coverage, depth (m). Cost: pixels x 3
// cameras.
#include <algorithm>
#include <array>
#include <limits>

#include "render/common/ray_cells.h"
#include "render/planar/focal_plane.h"
#include "render/planar/ray_plane_intersection.h"
#include "render/sampling/direction_visibility.h"
#include "render/sampling/reference_renderer.h"

namespace raystage::render {
namespace {

/// Returns the plane of the nearest object that the ray meets, or else `plane`.
const Eigen::Vector4d& sampling_plane(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray,
                                      std::span<const ObjectPlane> objects,
                                      const Eigen::Vector4d& plane) {
  const Eigen::Vector4d* met = &plane;
  double nearest = std::numeric_limits<double>::infinity();
  for (const ObjectPlane& object : objects) {
    const auto along = intersect_ray(object, eye, ray);
    if (!along || *along >= nearest) continue;
    nearest = *along;
    met = &object.plane;
  }
  return *met;
}

}  // namespace

RenderedView render_focal_plane_reference(const ViewRequest& request, CornerWeights weights,
                                          std::span<const ObjectPlane> objects) {
  const LightFieldFrame& instant = request.instant;
  const Eigen::Vector3d& eye = request.view.pose.position;
  VirtualCamera ideal_view = request.view;  // cells are located without lens distortion
  ideal_view.intrinsics.distortion = {};
  const RayCells present(ideal_view, *instant.rig, *instant.present);
  const RayCells complete(ideal_view, *instant.rig, *instant.complete);
  const auto locate = [&](const RayCells& cells, const Eigen::Vector2d& pixel) {
    const auto crossing = cells.locate(pixel.x(), pixel.y());
    return crossing && weights == CornerWeights::kNearest ? cells.nearest(*crossing) : crossing;
  };

  ReferenceRenderer renderer(request);
  return renderer.render([&](const ReferenceRay& ray, ReferencePixel& pixel) {
    const auto crossing = locate(present, ray.ideal_pixel);
    if (!crossing) return;
    const RayPlaneIntersection hit(
        eye, ray.direction, sampling_plane(eye, ray.direction, objects, request.focal_plane));
    if (!hit.is_in_front()) return;
    const RayCells::Cell& cell = present.cells()[crossing->cell];
    std::array<double, 3> sum{};
    double alpha = 0;
    for (int i = 0; i < cell.count; ++i) {
      const auto camera = static_cast<std::size_t>(cell.camera[i]);
      const rig::Rig::Camera& source = instant.rig->cameras[camera];
      Eigen::Vector2d position;
      const double seen = direction_visibility(source.model,
                                               source.pose.world_from_camera_rotation.transpose() *
                                                   hit.direction_from(source.pose.position),
                                               position);
      if (seen <= 0) continue;
      const FrameSample sample = renderer.frames().sample(camera, position);
      const double weight = crossing->weight[i] * seen;
      for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * sample.rgb[c];
      alpha += weight * sample.alpha;
    }
    if (!(alpha > 0)) return;
    for (double& value : sum) value /= alpha;
    pixel.rgba = premultiplied_light(sum, alpha, *instant.cache);
    pixel.z = static_cast<float>(hit.depth());
    pixel.coverage = pixel.rgba[3];
    const auto whole =
        instant.present == instant.complete ? std::nullopt : locate(complete, ray.ideal_pixel);
    if (!whole) return;
    const RayCells::Cell& whole_cell = complete.cells()[whole->cell];
    for (int i = 0; i < whole_cell.count; ++i) {
      if (instant.is_present(whole_cell.camera[i])) continue;
      pixel.coverage -= pixel.rgba[3] * static_cast<float>(whole->weight[i]);
    }
    pixel.coverage = std::max(0.0F, pixel.coverage);  // rounding may give less than 0
  });
}

}  // namespace raystage::render
