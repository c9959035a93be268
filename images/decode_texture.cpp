// SPDX-License-Identifier: Apache-2.0
// raystage-decode-texture, in lib/raystage: decodes PNG and JPEG textures for its parent process,
// see sandbox/.
#include "images/open_textures.h"
#include "sandbox/decoder_main.h"

int main(int argc, char** argv) {
  raystage::images::OpenTextures images;
  return raystage::sandbox::decoder_main(
      argc, argv, [&](std::span<const std::byte> request) { return images.answer(request); });
}
