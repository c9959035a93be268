// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/frame_rate.h"
#include "compose/camera/gltf_timing.h"
#include "rig/pose.h"

namespace raystage::compose {

/// An animated glTF 2.0 camera: y up, looking down -z, metres; time in seconds from the file's 0,
/// constant before the first and after the last key. Keys are interpolated as the file defines:
/// LINEAR (rotations by slerp), STEP or CUBICSPLINE.
struct GltfCamera {
  std::string name;                               ///< of the camera's node, or else of the camera
  std::function<rig::Pose(double seconds)> pose;  ///< in the world; without scale
  std::function<double(double seconds)> vertical_fov;  ///< full angle, radians
  bool fov_is_animated = false;
  std::vector<double> key_seconds;  ///< times of all keys, ascending; empty: not animated
  GltfTiming timing;
};

/// Reads one camera of a .gltf or .glb file. `name`: of its node or of the camera; empty: the only
/// camera. Buffers are read from files next to it, from the GLB, or from data URIs. Animations of
/// the camera's nodes and, by KHR_animation_pointer, of its field of view are used. Throws Error
/// (bad input) if there is no such camera, it is orthographic, or a node mirrors or skews it. It
/// does so, too, if a property is animated twice, a number is not finite, or the file is damaged.
GltfCamera read_gltf_camera(const std::filesystem::path& file, const std::string& name,
                            const GltfFrameRate& rate = {});
/// Parses the bytes of a file as read_gltf_camera() does. `file`: finds its buffers, and is named
/// by errors.
GltfCamera parse_gltf_camera(std::string_view bytes, const std::filesystem::path& file,
                             const std::string& name, const GltfFrameRate& rate = {});

/// A camera at one time.
struct GltfCameraKey {
  double seconds = 0;
  rig::Pose pose;
  double vertical_fov = 1;  ///< full angle, radians
};

/// Returns a .gltf document of one perspective camera with LINEAR keys of the properties that
/// change. `extras` of its `asset` state the frame rate as a ratio ("fps": "24/1") and the frame of
/// the first key ("first_frame"). KHR_animation_pointer animates the field of view; programs
/// without support for it show that of the first key. `aspect`: width / height. `keys`: at least
/// one, ascending times. Values are rounded to float. The text depends on the arguments only.
std::string format_gltf_camera(const std::string& name, double aspect,
                               std::span<const GltfCameraKey> keys, FrameRate rate,
                               int first_frame);

}  // namespace raystage::compose
