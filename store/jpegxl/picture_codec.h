// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "schemas/pixel_encoding.h"
#include "store/jpegxl/deep_picture.h"
#include "store/jpegxl/picture_coding.h"

namespace raystage::store {

/// Encodes and decodes pictures of more than 8 bits as JPEG XL. libjxl runs in processes of its own
/// (sandbox/), as many as threads call at once; they start with the first call. Thread-safe.
class PictureCodec {
 public:
  PictureCodec();
  ~PictureCodec();
  PictureCodec(PictureCodec&&) noexcept;
  PictureCodec& operator=(PictureCodec&&) noexcept;

  /// Returns the JPEG XL file of a picture. A lossless one was decoded again and compared. `file`:
  /// for errors. Throws Error (bad input) if libjxl cannot encode it or it does not return bit for
  /// bit, and Error (failed) if libjxl cannot be run.
  std::vector<std::byte> encode(const DeepPicture& picture, const schemas::PixelEncoding& encoding,
                                const PictureCompression& compression,
                                const std::filesystem::path& file) const;

  /// Returns the picture of a JPEG XL file, which has the stated size; all half floats are finite.
  /// `expected`: nullptr, or the encoding whose form and bits the picture must have. Throws
  /// Error (bad input) if libjxl cannot decode it or it is another picture, and Error (failed) if
  /// libjxl cannot be run.
  DeepPicture decode(std::span<const std::byte> coded_bytes, int width, int height,
                     const schemas::PixelEncoding* expected,
                     const std::filesystem::path& file) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Returns whether bytes begin as a codestream (FF 0A) or container of JPEG XL does.
bool is_jpeg_xl_picture(std::span<const std::byte> bytes);

}  // namespace raystage::store
