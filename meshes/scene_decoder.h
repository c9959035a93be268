// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "meshes/decoded_scene.h"
#include "sandbox/decoder_process.h"

namespace raystage::meshes {

struct DecodeOptions {
  bool applies_unit = true;  ///< convert the unit that a file states (FBX) to metres
  sandbox::Confinement confinement = sandbox::default_confinement();
};

/// Reads a mesh in any format that Assimp reads: glTF 2, FBX, OBJ, PLY ... Polygons are
/// triangulated; points and lines are left out. The decoder may read regular files below the mesh's
/// folder, without links, up to kMaxSceneBytes. Throws Error (bad input) if the file is missing,
/// cannot be decoded within a time and a memory that grow with its size, or has a number that is
/// not finite; Error (failed) as run_decoder().
DecodedScene decode_scene(const std::filesystem::path& file, const DecodeOptions& options = {});

}  // namespace raystage::meshes
