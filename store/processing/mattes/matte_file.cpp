// SPDX-License-Identifier: Apache-2.0
#include "store/processing/mattes/matte_file.h"

#include <fmt/format.h>

#include <string>
#include <utility>

#include "base/error.h"

namespace raystage::store {

ContainedPath matte_file(const Take& take, int camera, int frame) {
  return take.file(std::filesystem::path("mattes") / take.document().cameras[camera].id /
                   fmt::format("{:06}.png", frame));
}

std::vector<std::uint8_t> MatteReader::read(const ContainedPath& file, int width,
                                            int height) const {
  images::ImageValues<std::uint8_t> image = images_.read_grey(file);
  if (image.properties.width != width || image.properties.height != height) {
    throw Error::bad_input(
        fmt::format("the matte has {}x{} pixels, its camera {}x{}", image.properties.width,
                    image.properties.height, width, height),
        file.path().string(),
        fmt::format("Write an 8-bit grey PNG of {}x{} pixels (see docs/formats/mattes.md)", width,
                    height));
  }
  return std::move(image.values);
}

}  // namespace raystage::store
