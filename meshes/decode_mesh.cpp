// SPDX-License-Identifier: Apache-2.0
// raystage-decode-mesh, in lib/raystage: decodes a mesh for its parent process, see sandbox/.
#include <string>

#include "meshes/assimp_scene.h"
#include "meshes/scene_encoding.h"
#include "sandbox/byte_encoding.h"
#include "sandbox/decoder_main.h"

int main(int argc, char** argv) {
  using namespace raystage;
  return sandbox::decoder_main(
      argc, argv, [](std::span<const std::byte> request) -> std::vector<std::byte> {
        sandbox::ByteReader reader(request);
        const bool applies_unit = reader.read_flag();
        std::string file;
        reader.read_plain(file);
        return meshes::encode_scene(meshes::read_with_assimp(file, applies_unit));
      });
}
