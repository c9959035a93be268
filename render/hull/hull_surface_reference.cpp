// SPDX-License-Identifier: Apache-2.0
// Reference of hull_surface() (hull_surface.cpp): tests evenly spaced inverse distances (1/m) along
// each ray against every silhouette, through the lens, in double. Cost: O(rays x steps x cameras).
#include <algorithm>
#include <limits>

#include "render/hull/hull_surface.h"

namespace raystage::render {

RaySurface hull_surface_reference(const rig::Rig& rig, std::vector<Silhouette> silhouettes,
                                  int min_views, double nearest, int steps) {
  return [&rig, silhouettes = std::move(silhouettes), min_views, nearest, steps](
             std::span<const WorldRay> rays, std::span<double> inverse_distance) {
    const auto is_inside = [&](const WorldRay& ray, double inverse) {
      int seeing = 0;
      for (const Silhouette& silhouette : silhouettes) {
        const rig::Rig::Camera& camera = rig.cameras[silhouette.camera];
        const Eigen::Vector3d towards =
            ray.direction - (camera.pose.position - ray.origin) * inverse;
        const MatteValue value = silhouette.matte->at(
            camera.model, camera.pose.world_from_camera_rotation.transpose() * towards);
        if (value == MatteValue::kBackground) return false;
        seeing += value == MatteValue::kForeground ? 1 : 0;
      }
      return seeing >= min_views;
    };
    for (std::size_t i = 0; i < rays.size(); ++i) {
      inverse_distance[i] = std::numeric_limits<double>::quiet_NaN();
      for (int step = 0; step <= steps; ++step) {
        const double inverse = (1 - static_cast<double>(step) / steps) / nearest;
        if (!is_inside(rays[i], inverse)) continue;
        inverse_distance[i] = inverse;
        break;
      }
    }
  };
}

}  // namespace raystage::render
