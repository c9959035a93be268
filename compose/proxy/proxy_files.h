// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "compose/proxy/scene_proxy.h"

namespace raystage::compose {

/// Returns points as a binary PLY file (little-endian): x, y, z as float, red, green, blue as
/// uchar. World coordinates, metres, y up.
std::string format_ply(std::span<const ProxyPoint> points);

/// Returns a mesh as a GLB file (glTF 2.0) of one unlit node called `name`, with its texture as a
/// JPEG.
std::string format_glb(const ProxyMesh& mesh, const std::string& name);

}  // namespace raystage::compose
