// SPDX-License-Identifier: Apache-2.0
// Reference of the method aperture, per ray in double. A pixel is the mean of the samples of the
// cameras within the aperture around the ray, weighted by ApertureLens x visibility. Each sample is
// taken where the ray meets the plane. Output: R, G, B, A, coverage, depth (m). Cost: pixels x
// cameras.
#include <optional>

#include "render/common/ray_cells.h"
#include "render/planar/aperture.h"
#include "render/planar/aperture_lens.h"
#include "render/planar/depth_map.h"
#include "render/planar/ray_plane_intersection.h"
#include "render/sampling/direction_visibility.h"
#include "render/sampling/reference_renderer.h"

namespace raystage::render {

RenderedView render_aperture_reference(const ViewRequest& request) {
  const VirtualCamera& view = request.view;
  const LightFieldFrame& instant = request.instant;
  const Eigen::Vector3d& eye = view.pose.position;
  const double focus_distance = request.options.number("focus_distance");
  const Eigen::Vector4d plane =
      focus_distance > 0 ? view_parallel_plane(view, focus_distance) : request.focal_plane;
  const ApertureLens lens(view, instant, plane, request.options);
  const std::optional<ViewDepths> depths = make_view_depths(request);
  VirtualCamera ideal_view = view;  // cells are located without lens distortion
  ideal_view.intrinsics.distortion = {};
  const RayCells cells(ideal_view, *instant.rig, *instant.present);

  ReferenceRenderer renderer(request);
  return renderer.render([&](const ReferenceRay& ray, ReferencePixel& pixel) {
    const auto crossing = cells.locate(ray.ideal_pixel.x(), ray.ideal_pixel.y());
    if (!crossing) return;
    const RayPlaneIntersection hit =
        depths ? RayPlaneIntersection(eye, ray.direction,
                                      1 / static_cast<double>(depths->at(ray.x, ray.y)))
               : RayPlaneIntersection(eye, ray.direction, plane);
    if (!hit.is_in_front()) return;
    const RayCells::Cell& cell = cells.cells()[crossing->cell];
    const ApertureLens::Plane lens_plane = lens.plane_of(cell);
    const Eigen::Vector2d place = lens.place_of(cell, lens_plane, *crossing);
    std::array<double, 3> sum{};
    double seen_weight = 0, present = 0, complete = 0;
    RayCoverage behind;
    for (std::size_t i = 0; i < lens.cameras().size(); ++i) {
      const double weight = lens.weight(lens.cameras()[i], lens_plane, place);
      if (weight == 0) continue;
      complete += weight;
      if (!renderer.frames().has(i)) continue;
      present += weight;
      const rig::Rig::Camera& source = instant.rig->cameras[i];
      Eigen::Vector2d in_frame;
      const double seen = direction_visibility(source.model,
                                               source.pose.world_from_camera_rotation.transpose() *
                                                   hit.direction_from(source.pose.position),
                                               in_frame);
      if (seen <= 0) continue;
      const FrameSample sample = renderer.frames().sample(i, in_frame);
      for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * seen * sample.rgb[c];
      seen_weight += weight * seen * sample.alpha;
      behind.add(weight * seen, ray.direction, source.pose.position - eye);
    }
    pixel.cameras = behind.cameras();
    pixel.nearest_ray = behind.nearest_ray();
    if (!(seen_weight > 0)) return;
    for (double& value : sum) value /= seen_weight;
    const double alpha = seen_weight / present;
    pixel.rgba = premultiplied_light(sum, alpha, *instant.cache);
    pixel.coverage = static_cast<float>(alpha * present / complete);
    pixel.z = static_cast<float>(hit.depth());
  });
}

}  // namespace raystage::render
