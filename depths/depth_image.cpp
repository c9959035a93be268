// SPDX-License-Identifier: Apache-2.0
// Reads depth images of strangers: the pictures are decoded in confined processes, their sizes are
// checked from the headers before that. Cost: decoding.
#include "depths/depth_image.h"

#include <fmt/format.h>
#include <png.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <functional>
#include <string_view>

#include "base/error.h"
#include "depths/png_output.h"
#include "render/depth/imported_maps.h"

namespace raystage::depths {
namespace {

namespace fs = std::filesystem;
using render::InverseDepthMap;

constexpr double kMaxInverseDepth = 1e6;  // 1/m
constexpr const char* kCheckUnit =
    "Check the unit and the kind of depth that the files are imported with";
/// Pixels of four floats, which a decoder may need.
constexpr std::size_t kDecoderBytes = render::kMaxImportedPixels * 4 * sizeof(float);

bool has_extension(const fs::path& file, std::string_view wanted) {
  std::string extension = file.extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension == wanted;
}

void require_size(const fs::path& file, int width, int height) {
  constexpr int kMaxSide = 16384;
  if (width >= 1 && height >= 1 && width <= kMaxSide && height <= kMaxSide &&
      static_cast<std::size_t>(width) * static_cast<std::size_t>(height) <=
          render::kMaxImportedPixels) {
    return;
  }
  throw Error::bad_input(
      fmt::format("the depth map has {}x{} pixels, allowed: sides of 1 to {}, {} million in all",
                  width, height, kMaxSide, render::kMaxImportedPixels >> 20U),
      file.string(), "Scale it without interpolation: it need not have the size of the pictures");
}

/// Returns the inverse of depths in metres.
InverseDepthMap inverse_of(const fs::path& file, int width, int height,
                           const std::function<double(std::size_t)>& depth_of) {
  InverseDepthMap map(width, height, render::kUnknownDepth);
  for (std::size_t i = 0; i < map.values.size(); ++i) {
    const double depth = depth_of(i);
    if (!std::isfinite(depth) || depth == 0) continue;
    const double inverse = 1 / depth;
    if (depth < 0 || inverse > kMaxInverseDepth) {
      const auto columns = static_cast<std::size_t>(width);
      throw Error::bad_input(
          fmt::format("the depth at pixel ({}, {}) is {:g} m, allowed: at least 1e-06 m; 0, "
                      "infinity and NaN are unknown depths",
                      i % columns, i / columns, depth),
          file.string(), kCheckUnit);
    }
    map.values[i] = static_cast<float>(inverse);
  }
  return map;
}

}  // namespace

bool is_exr_file(const fs::path& file) { return has_extension(file, ".exr"); }
bool is_png_file(const fs::path& file) { return has_extension(file, ".png"); }

DepthImageReader::DepthImageReader() : exr_(kDecoderBytes), png_(kDecoderBytes) {}

InverseDepthMap DepthImageReader::read(const fs::path& file, const DepthEncoding& encoding) const {
  InverseDepthMap map = is_exr_file(file) ? read_exr(file, encoding) : read_png(file, encoding);
  if (std::ranges::none_of(map.values, [](float value) { return value >= 0; })) {
    throw Error::bad_input("the depth map has no known depth: all values are 0, infinite or NaN",
                           file.string(), "Export the depths again, or leave the file out");
  }
  return map;
}

InverseDepthMap DepthImageReader::read_exr(const fs::path& file,
                                           const DepthEncoding& encoding) const {
  if (encoding.inverse_range) {
    throw Error::bad_input("a range of inverse depths was stated, but EXR files hold depths",
                           file.string(), "State no range, or convert the files to 16-bit PNG");
  }
  const std::string name = encoding.channel.empty() ? "Z" : encoding.channel;
  const std::array channels{images::ExrChannel{name.c_str(), std::nullopt}};
  constexpr const char* kNameChannel = "State the channel that holds the depths";
  const std::array<int, 2> size = exr_.size(file, channels, kNameChannel);
  require_size(file, size[0], size[1]);
  const images::ExrChannelData data = exr_.read(file, channels, kNameChannel);
  require_size(file, data.width, data.height);
  const double unit = encoding.unit_m.value_or(1);
  return inverse_of(file, data.width, data.height,
                    [&](std::size_t i) { return double{data.values[i]} * unit; });
}

InverseDepthMap DepthImageReader::read_png(const fs::path& file,
                                           const DepthEncoding& encoding) const {
  if (!encoding.inverse_range && !encoding.unit_m) {
    throw Error::bad_input(
        "the codes of a PNG file are no metres, and no range or unit was stated", file.string(),
        "State the nearest and farthest depth of inverse-depth codes, or the metres of a code");
  }
  const images::ImageProperties properties = png_.properties(file);
  require_size(file, properties.width, properties.height);
  if (properties.type != images::PixelType::kUint16 || properties.channels != 1) {
    throw Error::bad_input(
        fmt::format(
            "the PNG file has {} channels of {} bits, but depth codes are one channel of 16",
            properties.channels, 8 * images::size_of(properties.type)),
        file.string(), "Export the depths as grey PNG files of 16 bits");
  }
  const images::ImageValues<float> image = png_.read_floats(file);
  require_size(file, image.properties.width, image.properties.height);
  if (image.properties.channels != 1) {
    throw Error::bad_input("the PNG file changed while it was read", file.string(),
                           "Import it again");
  }
  const auto code_at = [&](std::size_t i) {
    return static_cast<std::uint16_t>(
        std::lround(std::clamp(image.values[i], 0.0F, 1.0F) * float{kMaxDepthCode}));
  };
  if (!encoding.inverse_range) {
    return inverse_of(file, image.properties.width, image.properties.height,
                      [&](std::size_t i) { return code_at(i) * *encoding.unit_m; });
  }
  InverseDepthMap map(image.properties.width, image.properties.height);
  for (std::size_t i = 0; i < map.values.size(); ++i) {
    map.values[i] = inverse_depth_of_code(code_at(i), *encoding.inverse_range);
  }
  return map;
}

void append_png_bytes(png_structp png, png_bytep data, png_size_t size) {
  auto& out = *static_cast<std::vector<std::byte>*>(png_get_io_ptr(png));
  bool is_appended = true;
  try {
    const auto* first = reinterpret_cast<const std::byte*>(data);  // NOLINT: bytes are bytes
    out.insert(out.end(), first, first + size);
  } catch (const std::exception&) {
    is_appended = false;  // libpng's jump would skip the end of this handler
  }
  if (!is_appended) png_error(png, "out of memory");
}

std::vector<std::byte> encode_depth_png(const InverseDepthMap& map,
                                        const schemas::DepthRange& range, const std::string& name) {
  std::vector<std::uint16_t> codes;
  codes.reserve(map.values.size());
  for (const float value : map.values) codes.push_back(code_of_inverse_depth(value, range));
  // The simplified API of libpng takes 16 bits as linear light and would write a gamma of 1.
  struct Writer {
    png_structp png = nullptr;
    png_infop info = nullptr;
    ~Writer() { png_destroy_write_struct(&png, &info); }
  };
  std::vector<std::byte> bytes;
  std::array<char, 128> reason{};  // no std::string, which may throw in libpng's frames
  Writer writer;
  writer.png = png_create_write_struct(
      PNG_LIBPNG_VER_STRING, &reason,
      [](png_structp png, png_const_charp message) {
        auto& text = *static_cast<std::array<char, 128>*>(png_get_error_ptr(png));
        std::string_view(message).copy(text.data(), text.size() - 1);
        png_longjmp(png, 1);
      },
      nullptr);
  if (writer.png != nullptr) writer.info = png_create_info_struct(writer.png);
  if (writer.info == nullptr) throw std::bad_alloc();
  std::vector<png_bytep> rows;
  for (int y = 0; y < map.height; ++y) {
    rows.push_back(reinterpret_cast<png_bytep>(codes.data() + map.offset(0, y)));  // NOLINT
  }
  if (setjmp(png_jmpbuf(writer.png)) != 0) {  // NOLINT: libpng has no other way
    throw Error::failed(fmt::format("the image cannot be encoded: {}", reason.data()), name,
                        "Check that PNG allows the image size, and the free memory");
  }
  png_set_write_fn(writer.png, &bytes, append_png_bytes, nullptr);
  png_set_IHDR(writer.png, writer.info, static_cast<png_uint_32>(map.width),
               static_cast<png_uint_32>(map.height), 16, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_set_rows(writer.png, writer.info, rows.data());
  png_write_png(writer.png, writer.info, PNG_TRANSFORM_SWAP_ENDIAN, nullptr);
  return bytes;
}

}  // namespace raystage::depths
