// SPDX-License-Identifier: Apache-2.0
// raystage-decode-mesh, in lib/raystage: decodes a mesh for its parent process, see sandbox/.
#include <string_view>

#include "meshes/assimp_scene.h"
#include "meshes/scene_encoding.h"
#include "sandbox/decoder_main.h"

int main(int argc, char** argv) {
  return raystage::sandbox::decoder_main(
      argc, argv, [](std::span<const char* const> arguments) -> std::vector<std::byte> {
        if (arguments.size() != 2) return {};
        return raystage::meshes::encode_scene(raystage::meshes::read_with_assimp(
            arguments[0], std::string_view(arguments[1]) == "metres"));
      });
}
