// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <limits>

#include "base/parallel.h"
#include "render/lumigraph/lumigraph.h"
#include "render/lumigraph/reference_frames.h"

namespace raystage {

RenderedView render_lumigraph_reference(const ViewRequest& request, const RaySurface& surface,
                                        const RayWeightSettings& weighing, MissedRay missed) {
  const VirtualCamera& view = request.view;
  const LightFieldFrame& instant = request.instant;
  RenderedView image = empty_view(view);
  const auto start = std::chrono::steady_clock::now();
  ReferenceFrames frames(instant, request.count_needed_pixels, image.statistics);
  const auto decoded = std::chrono::steady_clock::now();
  const CameraModel view_model({"view", view.width, view.height, view.intrinsics, {}, {}, {}});
  const double spacing = max_neighbour_baseline(*instant.rig);

  if (request.measure_coverage) {
    image.cameras.assign(image.coverage.size(), 0.0F);
    image.nearest_ray = image.z;  // infinity
  }
  if (missed == MissedRay::kKnownEmpty) image.empty_space.assign(image.coverage.size(), 0.0F);

  const auto reconstruct = [&](int x, int y, std::size_t at) {
    const auto ray_in_view = view_model.unproject({x + 0.5, y + 0.5});
    if (!ray_in_view) return;
    const WorldRay ray{view.pose.position,
                       (view.pose.world_from_camera_rotation * *ray_in_view).normalized()};
    double inverse_distance = 0;
    surface({&ray, 1}, {&inverse_distance, 1});
    if (!(inverse_distance >= 0)) {
      if (missed == MissedRay::kKnownEmpty) image.empty_space[at] = 1;
      return;
    }
    const auto cameras = compute_camera_weights_reference(*instant.rig, frames.present(), ray,
                                                          inverse_distance, weighing, spacing);
    const auto pixel = frames.blend(cameras);
    std::copy(pixel.begin(), pixel.end(), &image.rgba[at * 4]);
    image.coverage[at] = pixel[3];
    if (request.measure_coverage) {
      image.cameras[at] = static_cast<float>(effective_cameras(cameras));
      image.nearest_ray[at] = static_cast<float>(nearest_ray(cameras));
    }
    if (!(pixel[3] > 0)) return;
    image.z[at] =
        static_cast<float>(view.pose.viewing_direction().dot(ray.direction) / inverse_distance);
    if (frames.present().size() == instant.included_cameras.size()) return;
    for (const WeightedCamera& camera : compute_camera_weights_reference(
             *instant.rig, instant.included_cameras, ray, inverse_distance, weighing, spacing)) {
      if (!instant.is_present(camera.camera))
        image.coverage[at] -= static_cast<float>(camera.weight) * pixel[3];
    }
  };

  raystage::parallel_for(0, view.height, [&](int y) {
    for (int x = 0; x < view.width; ++x) {
      const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(view.width) +
                             static_cast<std::size_t>(x);
      reconstruct(x, y, at);
    }
  });
  const auto end = std::chrono::steady_clock::now();
  image.statistics.pixels_needed = frames.pixels_needed();
  image.statistics.decode_ms = std::chrono::duration<double, std::milli>(decoded - start).count();
  image.statistics.render_ms = std::chrono::duration<double, std::milli>(end - decoded).count();
  return image;
}

}  // namespace raystage
