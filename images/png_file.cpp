// SPDX-License-Identifier: Apache-2.0
#include "images/png_file.h"

#include <png.h>

#include "base/atomic_file.h"
#include "base/error.h"

namespace raystage::images {

std::vector<std::byte> encode_png(const store::RgbImage& image, const std::string& name) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGB;
  const auto check = [&](int is_encoded) {
    if (is_encoded != 0) return;
    const std::string reason = png.message;
    png_image_free(&png);
    throw Error::failed("the image cannot be encoded: " + reason, name,
                        "Check that PNG allows the image size");
  };
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png);
  std::vector<std::byte> encoded(size);
  check(png_image_write_to_memory(&png, encoded.data(), &size, 0, image.values.data(), 0, nullptr));
  encoded.resize(size);
  return encoded;
}

void write_png(const store::RgbImage& image, const std::filesystem::path& file) {
  write_file_atomically(file, encode_png(image, file.string()));
}

}  // namespace raystage::images
