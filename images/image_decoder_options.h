// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

#include "sandbox/decoder_process.h"

namespace raystage::images {

/// Returns how raystage-decode-image is run. `kind`: of the images, named by errors;
/// `memory_bytes`: that the pixels of one may need.
inline sandbox::DecoderOptions image_decoder_options(const std::string& kind,
                                                     std::size_t memory_bytes) {
  // Readers hold pixels as they are in the file, as they are wanted, and as a result. OpenImageIO
  // converts rows in a buffer of 64 MiB, however small the image is.
  constexpr std::size_t kOther = std::size_t{128} << 20;
  sandbox::DecoderOptions options;
  options.program = "raystage-decode-image";
  options.kind = kind;
  options.advice = "Check that the file is an image, or save it again";
  options.memory_bytes = kOther + 4 * memory_bytes;
  options.result_bytes = memory_bytes + (std::size_t{1} << 20);
  options.time = std::chrono::seconds(120);
  return options;
}

}  // namespace raystage::images
