// SPDX-License-Identifier: Apache-2.0
#include "store/processing/mattes/matte_file.h"

#include <fmt/format.h>
#include <png.h>

#include <string>

#include "base/error.h"

namespace raystage::store {

std::filesystem::path matte_file_path(const Take& take, int camera, int frame) {
  return take.folder() / "mattes" / take.document().cameras[camera].id /
         fmt::format("{:06}.png", frame);
}

std::vector<std::uint8_t> read_matte_png(const std::filesystem::path& file, int width, int height) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  const auto matte_error = [&](const std::string& what) {
    png_image_free(&image);
    return Error::bad_input(what, file.string(),
                            fmt::format("Write an 8-bit grey PNG of {}x{} pixels (see "
                                        "docs/formats/mattes.md)",
                                        width, height));
  };
  if (png_image_begin_read_from_file(&image, file.c_str()) == 0) {
    throw matte_error(std::string("the matte cannot be read: ") + image.message);
  }
  if (static_cast<int>(image.width) != width || static_cast<int>(image.height) != height) {
    throw matte_error(fmt::format("the matte has {}x{} pixels, its camera {}x{}", image.width,
                                  image.height, width, height));
  }
  // Reads the codes unchanged: grey, without alpha, without conversion of the transfer function.
  image.format = PNG_FORMAT_GRAY;
  std::vector<std::uint8_t> codes(PNG_IMAGE_SIZE(image));
  const png_color black{0, 0, 0};
  if (png_image_finish_read(&image, &black, codes.data(), 0, nullptr) == 0) {
    throw matte_error(std::string("the matte cannot be read: ") + image.message);
  }
  return codes;
}

}  // namespace raystage::store
