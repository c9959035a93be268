// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "compose/proxy/scene_proxy.h"

namespace raystage::compose {

/// Returns points as a binary PLY file (little-endian): x, y, z as float, or as double if the cloud
/// has an origin other than the world's; red, green, blue as uchar. World coordinates, metres, y
/// up.
std::string format_ply(const PointCloud& cloud);

/// Returns a mesh as a GLB file (glTF 2.0) of one unlit node called `name`, with its texture as a
/// JPEG. The node's translation is the mesh's origin.
std::string format_glb(const ProxyMesh& mesh, const std::string& name);

}  // namespace raystage::compose
