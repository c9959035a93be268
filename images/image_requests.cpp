// SPDX-License-Identifier: Apache-2.0
#include "images/image_requests.h"

#include <fmt/format.h>

#include <array>
#include <utility>

namespace raystage::images {
namespace {

constexpr int kMaxSide = 1 << 20, kMaxChannels = 1024;

template <class Properties>
auto numbers_of(Properties& p) {
  return std::array{&p.x,          &p.y,           &p.width,      &p.height,
                    &p.full_x,     &p.full_y,      &p.full_width, &p.full_height,
                    &p.tile_width, &p.tile_height, &p.channels,   &p.alpha_channel};
}

bool is_size(int value) { return value > 0 && value <= kMaxSide; }
bool is_place(int value) { return value >= -kMaxSide && value <= kMaxSide; }

}  // namespace

void write_source(sandbox::ByteWriter& writer, const ImageSource& source) {
  writer.write_plain(source.name);
  writer.write_plain(source.format);
  writer.write_plain(source.bytes);
  writer.write(source.memory_bytes);
}

void require_memory_for_pixels(int width, int height, int channels, std::size_t value_bytes,
                               std::uint64_t granted_bytes) {
  const double bytes =
      static_cast<double>(width) * height * channels * static_cast<double>(value_bytes);
  if (bytes <= static_cast<double>(granted_bytes)) return;
  throw std::runtime_error(
      fmt::format("{} x {} pixels of {} channels need {:.0f} MB of memory; {:.0f} MB are granted",
                  width, height, channels, bytes / 1e6, static_cast<double>(granted_bytes) / 1e6));
}

ImageSource read_source(sandbox::ByteReader& reader) {
  ImageSource source;
  reader.read_plain(source.name);
  reader.read_plain(source.format);
  reader.read_plain(source.bytes);
  reader.read(source.memory_bytes);
  return source;
}

void write_properties(sandbox::ByteWriter& writer, const ImageProperties& properties) {
  for (const int* number : numbers_of(properties)) writer.write(*number);
  writer.write(static_cast<std::uint8_t>(properties.type));
}

ImageProperties read_properties(sandbox::ByteReader& reader) {
  ImageProperties properties;
  for (int* number : numbers_of(properties)) reader.read(*number);
  properties.type = read_pixel_type(reader);
  const ImageProperties& p = properties;
  const bool has_tiles = p.tile_width != 0 || p.tile_height != 0;
  sandbox::ByteReader::require(
      is_size(p.width) && is_size(p.height) && is_size(p.full_width) && is_size(p.full_height) &&
      is_place(p.x) && is_place(p.y) && is_place(p.full_x) && is_place(p.full_y) &&
      (!has_tiles || (is_size(p.tile_width) && is_size(p.tile_height))) && p.channels > 0 &&
      p.channels <= kMaxChannels && p.alpha_channel >= -1 && p.alpha_channel < p.channels);
  return properties;
}

PixelType read_pixel_type(sandbox::ByteReader& reader) {
  const auto type = reader.read<std::uint8_t>();
  sandbox::ByteReader::require(type <= static_cast<std::uint8_t>(PixelType::kFloat));
  return static_cast<PixelType>(type);
}

}  // namespace raystage::images
