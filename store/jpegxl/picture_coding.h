// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "schemas/pixel_encoding.h"
#include "store/jpegxl/deep_picture.h"

namespace raystage::store {

/// How a picture is compressed.
struct PictureCompression {
  /// 0: without loss; otherwise libjxl's Butteraugli distance, up to 25 (1: visually lossless).
  double distance = 0;
  int effort = 2;  ///< 1 to 9, as cjxl's; the higher the smaller and slower
};

/// A picture with what its file states of the samples.
struct CodedPicture {
  DeepPicture picture;
  schemas::PixelEncoding::Samples samples{};
  int bits = 0;
};

/// Returns a JPEG XL file of a picture (a container with one codestream), which states size, bits,
/// transfer function and primaries. Throws std::runtime_error with the reason if libjxl cannot
/// encode it, or std::bad_alloc. One thread. Only for decoders' programs and tests.
std::vector<std::byte> encode_picture(const DeepPicture& picture,
                                      const schemas::PixelEncoding& encoding,
                                      const PictureCompression& compression);

/// Returns the picture of such a file. A picture of more than `max_pixels`, with other than three
/// channels of 9 to 16 bits, or with several frames is refused before anything is decoded. Throws
/// std::runtime_error with the reason, or std::bad_alloc. For the same programs.
CodedPicture decode_picture(std::span<const std::byte> file, std::uint64_t max_pixels);

}  // namespace raystage::store
