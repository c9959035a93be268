// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "meshes/decoded_scene.h"

namespace raystage::meshes {

/// Returns a scene as bytes, for decode_scene_bytes() of the same program version. Numbers are in
/// the machine's order; arrays and strings begin with their count, 64 bits.
std::vector<std::byte> encode_scene(const DecodedScene& scene);

/// Returns the scene of these bytes, which may come from a process that a stranger controls. Throws
/// std::runtime_error with the reason if they break a promise of DecodedScene.
DecodedScene decode_scene_bytes(std::span<const std::byte> bytes);

}  // namespace raystage::meshes
