// SPDX-License-Identifier: Apache-2.0
// raystage-decode-image, in lib/raystage: decodes images for its parent process, see sandbox/.
#include "images/open_images.h"
#include "sandbox/decoder_main.h"

int main(int argc, char** argv) {
  raystage::images::OpenImages images;
  return raystage::sandbox::decoder_main(
      argc, argv, [&](std::span<const std::byte> request) { return images.answer(request); });
}
