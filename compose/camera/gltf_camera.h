// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rig/pose.h"

namespace raystage {

/// A glTF camera with what moves it, as glTF 2.0 says: Y up, looking down -z, metres; time in
/// seconds from the file's 0, held before the first and after the last key. Its own interpolation
/// is kept: LINEAR (rotations by slerp), STEP or CUBICSPLINE.
struct GltfCamera {
  std::string name;                          ///< of the node that carries it, else of the camera
  std::function<Pose(double seconds)> pose;  ///< of all nodes above it, too; scale left out
  std::function<double(double seconds)> vertical_fov;  ///< full angle, radians
  double last_seconds = 0;                             ///< of its keys; 0: it stands still
};

/// Reads one camera of a .gltf or .glb file: `name` is that of its node or of the camera; empty:
/// the only one there is. Buffers beside the file, in it, or in data URIs. Animations of the
/// camera's nodes and, by KHR_animation_pointer, of its field of view are followed. Throws Error
/// (bad input): no such camera, an orthographic one, a node that mirrors or skews, two animations
/// of the same thing, numbers that are not finite, a damaged file.
GltfCamera read_gltf_camera(const std::filesystem::path& file, const std::string& name);
/// The same of a file's bytes.
GltfCamera parse_gltf_camera(std::string_view bytes, const std::filesystem::path& file,
                             const std::string& name);

/// A camera at a moment.
struct GltfCameraKey {
  double seconds = 0;
  Pose pose;
  double vertical_fov = 1;  ///< full angle, radians
};

/// A .gltf document of one perspective camera with LINEAR keys: what moves is animated; the field
/// of view by KHR_animation_pointer, which programs that do not know it pass over, with the first
/// key's in place. `aspect`: width / height. Floats, as glTF keeps them. The text is the same for
/// the same keys. `keys`: at least one, by rising time.
std::string format_gltf_camera(const std::string& name, double aspect,
                               std::span<const GltfCameraKey> keys);

}  // namespace raystage
