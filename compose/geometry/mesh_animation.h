// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "compose/camera/gltf_timing.h"

namespace raystage::compose {

/// The motion of the nodes of a glTF file.
struct MeshAnimation {
  /// Returns the transforms of all nodes in depth-first order, at seconds from the file's 0.
  std::function<std::vector<Eigen::Affine3d>(double seconds)> file_from_node;
  std::vector<double> key_seconds;  ///< times of all keys, ascending
  GltfTiming timing;
};

/// Reads the animations of a .gltf or .glb file: LINEAR, STEP and CUBICSPLINE keys of translations,
/// rotations and scales. `bytes`: of the file. `node_names`: of the nodes in depth-first order, as
/// the meshes were read; empty: not checked. `mesh_nodes`: indices of those whose motion counts,
/// with that of their ancestors. Returns nothing if none of these moves. Throws Error (bad input)
/// if the file is damaged, if a property is animated twice, or if its nodes are not those of
/// `node_names`.
std::optional<MeshAnimation> parse_mesh_animation(std::string_view bytes,
                                                  const std::filesystem::path& file,
                                                  const GltfFrameRate& rate,
                                                  std::span<const std::string> node_names,
                                                  std::span<const std::size_t> mesh_nodes);

}  // namespace raystage::compose
