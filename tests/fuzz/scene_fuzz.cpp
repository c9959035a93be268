// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as the scene that a decoder returns: it is read and written back unchanged, with
// all indices in range, or refused.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <stdexcept>

#include "meshes/scene_encoding.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace raystage::meshes;
  try {
    const DecodedScene scene = decode_scene_bytes(std::as_bytes(std::span(data, size)));
    for (const DecodedScene::Mesh& mesh : scene.meshes) {
      for (const auto& corners : mesh.corners) {
        if (std::ranges::max(corners) >= mesh.positions.size()) std::abort();
      }
    }
    const auto once = encode_scene(scene);
    if (encode_scene(decode_scene_bytes(once)) != once) std::abort();
  } catch (const std::runtime_error&) {
    // refused
  }
  return 0;
}
