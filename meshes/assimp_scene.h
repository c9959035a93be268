// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "meshes/decoded_scene.h"

namespace raystage::meshes {

/// Reads a file with Assimp, in the decoder's process. `applies_unit`: see DecodeOptions. Throws
/// std::runtime_error with the reason if it cannot be read; on damaged files anything may happen.
DecodedScene read_with_assimp(const std::string& file, bool applies_unit);

}  // namespace raystage::meshes
