// SPDX-License-Identifier: Apache-2.0
#include "compose/camera/camera_export.h"

#include <cmath>
#include <vector>

#include "compose/camera/gltf_camera.h"

namespace raystage::compose {
namespace {

double vertical_fov(const render::VirtualCamera& view) {
  return 2 * std::atan(view.height / (2 * view.intrinsics.fy));
}

}  // namespace

std::string camera_to_chan(const ShotCamera& camera, std::span<const int> frames, Eye eye,
                           RotationOrder order) {
  std::vector<ChanLine> lines;
  for (const int frame : frames) {
    const render::VirtualCamera view = camera.camera(frame, eye);
    lines.push_back({static_cast<double>(frame), view.pose.position,
                     Eigen::Quaterniond(view.pose.world_from_camera_rotation), vertical_fov(view)});
  }
  return format_chan(lines, order);
}

std::string camera_to_gltf(const ShotCamera& camera, const schemas::ShotDocument& shot,
                           std::span<const int> frames, Eye eye, const std::string& name) {
  std::vector<GltfCameraKey> keys;
  for (const int frame : frames) {
    const render::VirtualCamera view = camera.camera(frame, eye);
    keys.push_back({(static_cast<double>(frame) - shot.first_frame) * shot.fps_denominator /
                        shot.fps_numerator,
                    view.pose, vertical_fov(view)});
  }
  return format_gltf_camera(name, static_cast<double>(shot.width) / shot.height, keys);
}

}  // namespace raystage::compose
