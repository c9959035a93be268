// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace raystage::testing {

/// Returns a grey PNG of 8 bits that states a size and holds 100 zeros. All checksums of its chunks
/// are right, so that decoders believe the size.
inline std::string png_that_states(std::uint32_t width, std::uint32_t height) {
  const auto number = [](std::uint32_t value) {
    std::string bytes;
    for (const int shift : {24, 16, 8, 0}) bytes += static_cast<char>(value >> shift & 0xffU);
    return bytes;
  };
  const auto crc32 = [](std::string_view text) {
    std::uint32_t crc = ~std::uint32_t{0};
    for (const char c : text) {
      crc ^= static_cast<unsigned char>(c);
      for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1 ? 0xEDB88320U : 0U);
    }
    return ~crc;
  };
  const auto chunk = [&](const std::string& type, const std::string& data) {
    return number(static_cast<std::uint32_t>(data.size())) + type + data +
           number(crc32(type + data));
  };
  const std::string form{'\x08', '\0', '\0', '\0', '\0'};  // 8 bits, grey
  // zlib's header, and a stored block of 100 bytes that is not the last one.
  const std::string pixels =
      std::string{'\x78', '\x01', '\0', '\x64', '\0', '\x9b', '\xff'} + std::string(100, '\0');
  return "\x89PNG\r\n\x1a\n" + chunk("IHDR", number(width) + number(height) + form) +
         chunk("IDAT", pixels) + chunk("IEND", "");
}

inline void write_png_that_states(const std::filesystem::path& file, std::uint32_t width,
                                  std::uint32_t height) {
  std::ofstream(file, std::ios::binary) << png_that_states(width, height);
}

}  // namespace raystage::testing
