// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "images/image_properties.h"
#include "sandbox/byte_encoding.h"

namespace raystage::images {

/// What raystage-decode-image and raystage-decode-texture are asked for. Texts and numbers follow
/// as named. The latter answers kOpen with nothing if only the former reads the image.
enum class ImageRequest : std::uint8_t {
  kProperties,  ///< source; result: properties
  kRead,        ///< source, pixel type; result: properties and all pixels of the first level
  kOpen,        ///< number to give to the image (std::uint32_t), source; result: properties
  kLevel,       ///< number, subimage, level; result: properties, or nothing if there is none
  kRows,        ///< number, subimage, level, first and last row + 1, pixel type; result: pixels
  kTile,        ///< number, subimage, level, x, y of its corner, pixel type; result: pixels
  kClose        ///< number
};

/// An image file, or one that is in memory.
struct ImageSource {
  std::string name;
  std::string format;              ///< extension that names the format; empty: a file
  std::string bytes = {};          ///< of the image in memory
  std::uint64_t memory_bytes = 0;  ///< that its pixels may need
};

/// First bytes of files.
inline constexpr std::string_view kPngSignature = "\x89PNG\r\n\x1a\n";
inline constexpr std::string_view kJpegSignature = "\xff\xd8\xff";

/// Throws std::runtime_error, which states both, if pixels need more memory than is granted.
void require_memory_for_pixels(int width, int height, int channels, std::size_t value_bytes,
                               std::uint64_t granted_bytes);

void write_source(sandbox::ByteWriter& writer, const ImageSource& source);
ImageSource read_source(sandbox::ByteReader& reader);

void write_properties(sandbox::ByteWriter& writer, const ImageProperties& properties);
/// Throws std::runtime_error if they are not those of an image.
ImageProperties read_properties(sandbox::ByteReader& reader);

/// Throws std::runtime_error if it is none.
PixelType read_pixel_type(sandbox::ByteReader& reader);

}  // namespace raystage::images
