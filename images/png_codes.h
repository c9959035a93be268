// SPDX-License-Identifier: Apache-2.0
// For raystage-decode-texture, which decodes damaged files: see sandbox/.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "images/image_properties.h"

namespace raystage::images {

/// A PNG image as OpenImageIO reads it: 8 or 16 bits in the byte order of the machine, palettes and
/// less than 8 bits expanded, transparency as alpha. Codes are those of the file.
struct PngCodes {
  ImageProperties properties;
  std::vector<std::uint8_t>
      codes;  ///< bytes of rows from the top; empty: only properties were read
};

/// Reads bytes of a file in order. Returns false where there are fewer. Must not throw: libpng
/// calls it.
using ReadBytes = std::function<bool(std::byte* to, std::size_t count)>;

/// Reads a PNG image. `accept`: called with the properties before pixels are allocated; false: they
/// are not read. Throws std::runtime_error with libpng's reason for damaged files.
PngCodes read_png_codes(const ReadBytes& read,
                        const std::function<bool(const ImageProperties&)>& accept);

}  // namespace raystage::images
