// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "images/image_properties.h"
#include "sandbox/decoder_pool.h"
#include "store/jpeg/rgb_image.h"

namespace raystage::images {

/// The values of an image, row by row, pixel by pixel, all channels of each.
template <class Value>
struct ImageValues {
  ImageProperties properties;
  std::vector<Value> values;
};

/// Reads image files (PNG, JPEG, TIFF, OpenEXR and whatever else OpenImageIO reads) in confined
/// processes, which stay until the reader ends. Colours of files with alpha come premultiplied.
/// Thread-safe. All functions throw Error (bad input) if the file is missing, no image, damaged, or
/// needs more memory than was granted, and Error (failed) as sandbox::DecoderProcess does.
class ImageReader {
 public:
  /// `memory_bytes`: that the pixels of an image may need; 0: half of the machine's.
  explicit ImageReader(std::size_t memory_bytes = 0);
  /// Returns a reader of PNG files with at most 8 bits, which starts within milliseconds. It gives
  /// R, G, B (not premultiplied) and A whatever the file has; its errors name a plate.
  static ImageReader of_png_plates(std::size_t memory_bytes = 0);

  /// Returns what the header states.
  ImageProperties properties(const std::filesystem::path& file) const;
  /// Returns values as codes of 8 bits: 0 to 1 becomes 0 to 255.
  ImageValues<std::uint8_t> read_codes(const std::filesystem::path& file) const;
  /// Returns floats as they are, and integers as shares of full scale.
  ImageValues<float> read_floats(const std::filesystem::path& file) const;
  /// Returns R, G, B codes of 8 bits, without colour conversion; grey becomes R = G = B, alpha is
  /// dropped.
  store::RgbImage read_rgb(const std::filesystem::path& file) const;

 private:
  ImageReader(std::size_t memory_bytes, sandbox::DecoderOptions options);
  template <class Value>
  ImageValues<Value> read(const std::filesystem::path& file, PixelType type) const;

  std::size_t memory_bytes_;
  sandbox::DecoderPool decoders_;
};

}  // namespace raystage::images
