// SPDX-License-Identifier: Apache-2.0
#include "ingest/source_image.h"

#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/transfer_function.h"
#include "images/image_file.h"

namespace raystage::ingest {
namespace {

std::unique_ptr<OIIO::ImageInput> open_image(const std::filesystem::path& file) {
  auto input = OIIO::ImageInput::open(file.string());
  if (!input) {
    throw Error::bad_input("the image cannot be read: " + OIIO::geterror(), file.string(),
                           "Check that the file exists and is an image");
  }
  return input;
}

std::uint8_t code_from_linear(float linear) {
  // This comparison maps NaN to black.
  const double clipped = linear > 0 ? std::min<double>(linear, 1) : 0;
  return static_cast<std::uint8_t>(std::lround(srgb_from_linear(clipped) * 255));
}

store::RgbImage read_linear(OIIO::ImageInput& input, const std::filesystem::path& file) {
  const OIIO::ImageSpec& spec = input.spec();
  const auto channels = static_cast<std::size_t>(spec.nchannels);
  const auto pixels = static_cast<std::size_t>(spec.width) * static_cast<std::size_t>(spec.height);
  std::vector<float> values(pixels * channels);
  if (!input.read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::FLOAT, values.data())) {
    throw Error::bad_input("the image is damaged: " + input.geterror(), file.string(),
                           "Replace the file");
  }
  store::RgbImage image{spec.width, spec.height, std::vector<std::uint8_t>(pixels * 3)};
  for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t source = channels >= 3 ? c : 0;
      image.values[pixel * 3 + c] = code_from_linear(values[pixel * channels + source]);
    }
  }
  return image;
}

}  // namespace

SourceImageSize image_size(const std::filesystem::path& file) {
  const auto input = open_image(file);
  return {input->spec().width, input->spec().height};
}

store::RgbImage read_source_image(const std::filesystem::path& file, SourceImageSize size,
                                  bool linear) {
  const auto input = open_image(file);
  const OIIO::ImageSpec& spec = input->spec();
  check_image_size({spec.width, spec.height}, size, file.string());
  if (linear) return read_linear(*input, file);
  if (spec.format.is_floating_point()) {
    throw Error::bad_input(
        "the image has floating-point values, but color_space is \"srgb_texture\"", file.string(),
        "Set color_space to \"lin_rec709_scene\" if the values are linear light, or convert the "
        "image to 8 or 16 bits");
  }
  return images::read_image(file);
}

void check_image_size(SourceImageSize found, SourceImageSize expected, std::string_view name) {
  if (found == expected) return;
  throw Error::bad_input(fmt::format("the image is {}x{}, but its camera is {}x{}", found.width,
                                     found.height, expected.width, expected.height),
                         std::string(name),
                         "Correct the camera's width and height, or replace the image");
}

}  // namespace raystage::ingest
