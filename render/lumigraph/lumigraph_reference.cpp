// SPDX-License-Identifier: Apache-2.0
// Reference of render_lumigraph() (lumigraph.cpp, ray_chunk_kernels.cpp): ray by ray in double,
// weights of all cameras per pixel (ray_weights.cpp), for any view. Output as lumigraph.cpp. Cost:
// O(pixels x cameras), all frames decoded.
#include "render/lumigraph/blend_reference.h"
#include "render/lumigraph/lumigraph.h"

namespace raystage::render {

RenderedView render_lumigraph_reference(const ViewRequest& request, const RaySurface& surface,
                                        const RayWeightOptions& weighing, MissedRay missed) {
  const LightFieldFrame& instant = request.instant;
  const rig::Pose& pose = request.view.pose;
  const double spacing = mean_nearest_baseline(*instant.rig);
  ReferenceRenderer renderer(request);
  const std::vector<int>& present = renderer.frames().present();
  RenderedView image = renderer.render([&](const ReferenceRay& pixel_ray, ReferencePixel& pixel) {
    const WorldRay ray{pose.position, pixel_ray.direction.normalized()};
    double inverse_distance = 0;
    surface({&ray, 1}, {&inverse_distance, 1});
    if (!(inverse_distance >= 0)) {
      if (missed == MissedRay::kKnownEmpty) pixel.empty_space = 1;
      return;
    }
    const auto cameras = compute_camera_weights_reference(*instant.rig, present, ray,
                                                          inverse_distance, weighing, spacing);
    pixel.rgba = blend_reference(renderer.frames(), cameras, *instant.cache);
    pixel.coverage = pixel.rgba[3];
    pixel.cameras = static_cast<float>(effective_cameras(cameras));
    pixel.nearest_ray = static_cast<float>(nearest_ray(cameras));
    if (!(pixel.rgba[3] > 0)) return;
    pixel.z = static_cast<float>(pose.viewing_direction().dot(ray.direction) / inverse_distance);
    if (present.size() == instant.included_cameras.size()) return;
    for (const WeightedCamera& camera : compute_camera_weights_reference(
             *instant.rig, instant.included_cameras, ray, inverse_distance, weighing, spacing)) {
      if (instant.is_present(camera.camera)) continue;
      pixel.coverage -= static_cast<float>(camera.weight) * pixel.rgba[3];
    }
  });
  if (missed == MissedRay::kKnownEmpty) image.empty_space.resize(image.coverage.size(), 0.0F);
  return image;
}

}  // namespace raystage::render
