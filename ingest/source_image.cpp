// SPDX-License-Identifier: Apache-2.0
#include "ingest/source_image.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/transfer_function.h"

namespace raystage::ingest {
namespace {

std::uint8_t code_from_linear(float linear) {
  // This comparison maps NaN to black.
  const double clipped = linear > 0 ? std::min<double>(linear, 1) : 0;
  return static_cast<std::uint8_t>(std::lround(srgb_from_linear(clipped) * 255));
}

store::RgbImage read_linear(const images::ImageReader& reader, const std::filesystem::path& file) {
  const images::ImageValues<float> light = reader.read_floats(file);
  const auto channels = static_cast<std::size_t>(light.properties.channels);
  store::RgbImage image(light.properties.width, light.properties.height);
  for (std::size_t pixel = 0; pixel < light.properties.pixels(); ++pixel) {
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t source = channels >= 3 ? c : 0;
      image.values[pixel * 3 + c] = code_from_linear(light.values[pixel * channels + source]);
    }
  }
  return image;
}

}  // namespace

SourceImageSize image_size(const images::ImageReader& reader, const std::filesystem::path& file) {
  const images::ImageProperties properties = reader.properties(file);
  return {properties.width, properties.height};
}

store::RgbImage read_source_image(const images::ImageReader& reader,
                                  const std::filesystem::path& file, SourceImageSize size,
                                  bool linear) {
  const images::ImageProperties properties = reader.properties(file);
  check_image_size({properties.width, properties.height}, size, file.string());
  if (linear) return read_linear(reader, file);
  if (!properties.holds_integers()) {
    throw Error::bad_input(
        "the image has floating-point values, but color_space is \"srgb_texture\"", file.string(),
        "Set color_space to \"lin_rec709_scene\" if the values are linear light, or convert the "
        "image to 8 or 16 bits");
  }
  return reader.read_rgb(file);
}

void check_image_size(SourceImageSize found, SourceImageSize expected, std::string_view name) {
  if (found == expected) return;
  throw Error::bad_input(fmt::format("the image is {}x{}, but its camera is {}x{}", found.width,
                                     found.height, expected.width, expected.height),
                         std::string(name),
                         "Correct the camera's width and height, or replace the image");
}

}  // namespace raystage::ingest
