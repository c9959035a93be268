// SPDX-License-Identifier: Apache-2.0
#include "testing/render/test_matte.h"

#include <fmt/format.h>
#include <png.h>

#include <stdexcept>

namespace raystage::testing {

void write_matte(const std::filesystem::path& take, const std::string& camera, int frame, int width,
                 int height, std::span<const std::uint8_t> codes) {
  const auto file = take / "mattes" / camera / fmt::format("{:06}.png", frame);
  std::filesystem::create_directories(file.parent_path());
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(width);
  image.height = static_cast<png_uint_32>(height);
  image.format = PNG_FORMAT_GRAY;
  if (png_image_write_to_file(&image, file.c_str(), 0, codes.data(), 0, nullptr) == 0) {
    throw std::runtime_error(std::string("no matte written: ") + image.message);
  }
}

}  // namespace raystage::testing
