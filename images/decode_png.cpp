// SPDX-License-Identifier: Apache-2.0
// raystage-decode-png, in lib/raystage: decodes PNG files of 8 bits for its parent process, see
// sandbox/. The codes are those of the file: libpng does not convert them.
#include <fmt/format.h>
#include <png.h>

#include <cstdint>
#include <memory>
#include <stdexcept>

#include "images/image_requests.h"
#include "sandbox/decoder_main.h"

namespace {

using namespace raystage;
using namespace raystage::images;

struct Free {
  void operator()(png_image* image) const {
    png_image_free(image);
    delete image;
  }
};

std::vector<std::byte> answer(std::span<const std::byte> request) {
  sandbox::ByteReader reader(request);
  const auto kind = static_cast<ImageRequest>(reader.read<std::uint8_t>());
  const ImageSource source = read_source(reader);
  const std::unique_ptr<png_image, Free> png(new png_image{});
  png->version = PNG_IMAGE_VERSION;
  if (png_image_begin_read_from_file(png.get(), source.name.c_str()) == 0) {
    throw std::runtime_error(png->message);
  }
  if ((png->format & PNG_FORMAT_FLAG_LINEAR) != 0) throw std::runtime_error("it has 16 bits");
  png->format = PNG_FORMAT_RGBA;
  const ImageProperties properties{.width = static_cast<int>(png->width),
                                   .height = static_cast<int>(png->height),
                                   .full_width = static_cast<int>(png->width),
                                   .full_height = static_cast<int>(png->height),
                                   .channels = 4,
                                   .alpha_channel = 3};
  const std::size_t bytes = std::size_t{4} * png->width * png->height;
  if (bytes > source.memory_bytes) {
    constexpr double kMegabyte = 1e6;
    throw std::runtime_error(
        fmt::format("its {}x{} pixels need {:.0f} MB of memory, and {:.0f} MB are granted",
                    png->width, png->height, static_cast<double>(bytes) / kMegabyte,
                    static_cast<double>(source.memory_bytes) / kMegabyte));
  }
  sandbox::ByteWriter result;
  write_properties(result, properties);
  if (kind == ImageRequest::kProperties) return result.take();
  std::vector<std::byte> pixels(bytes);
  if (png_image_finish_read(png.get(), nullptr, pixels.data(), 0, nullptr) == 0) {
    throw std::runtime_error(png->message);
  }
  result.append(pixels);
  return result.take();
}

}  // namespace

int main(int argc, char** argv) { return sandbox::decoder_main(argc, argv, answer); }
