// SPDX-License-Identifier: Apache-2.0
// Encodes object ids as Cryptomatte 1.2 specifies (Friedman and Jones, SIGGRAPH 2015). An id is the
// MurmurHash3_x86_32 of a name. Hashes that would be zero, a denormal number, an infinity or NaN
// get another exponent. Input: kIdRanks pairs of id and share of alpha per pixel. Output: the ids
// and coverages as three AOVs of R, G, B, A. Cost: pixels x kIdRanks.
#include "compose/layers/cryptomatte.h"

#include <fmt/format.h>

#include <bit>
#include <cstring>
#include <nlohmann/json.hpp>

namespace raystage::compose {
namespace {

constexpr std::uint32_t kFirst = 0xcc9e2d51U, kSecond = 0x1b873593U;

std::uint32_t mixed(std::uint32_t block) { return std::rotl(block * kFirst, 15) * kSecond; }

}  // namespace

std::uint32_t murmur3_32(std::string_view text) {
  std::uint32_t hash = 0;
  std::size_t at = 0;
  for (; at + 4 <= text.size(); at += 4) {
    std::uint32_t block = 0;
    std::memcpy(&block, text.data() + at, 4);  // as on little-endian hosts
    hash = std::rotl(hash ^ mixed(block), 13) * 5 + 0xe6546b64U;
  }
  std::uint32_t rest = 0;
  for (std::size_t i = text.size(); i-- > at;) {
    rest = rest << 8 | static_cast<unsigned char>(text[i]);
  }
  if (at < text.size()) hash ^= mixed(rest);
  hash ^= static_cast<std::uint32_t>(text.size());
  hash = (hash ^ hash >> 16) * 0x85ebca6bU;
  hash = (hash ^ hash >> 13) * 0xc2b2ae35U;
  return hash ^ hash >> 16;
}

float object_id(std::string_view name) {
  std::uint32_t bits = murmur3_32(name);
  const std::uint32_t exponent = bits >> 23 & 255;
  if (exponent == 0 || exponent == 255) bits ^= 1U << 23;
  return std::bit_cast<float>(bits);
}

std::string cryptomatte_manifest(std::span<const std::string> names) {
  auto manifest = nlohmann::ordered_json::object();
  for (const std::string& name : names) {
    manifest[name] = fmt::format("{:08x}", std::bit_cast<std::uint32_t>(object_id(name)));
  }
  // Names come from files: replace invalid UTF-8.
  return manifest.dump(-1, ' ', true, nlohmann::ordered_json::error_handler_t::replace);
}

std::string cryptomatte_key() {
  return fmt::format("{:08x}", murmur3_32(kCryptomatteName)).substr(0, 7);
}

void assign_object_id(LayerImage& image, float id) {
  image.ids.assign(image.pixels() * 2 * kIdRanks, 0.0F);
  for (std::size_t pixel = 0; pixel < image.pixels(); ++pixel) {
    image.ids[2 * kIdRanks * pixel] = id;
    image.ids[2 * kIdRanks * pixel + 1] = 1;
  }
}

std::vector<Aov> cryptomatte_aovs(const LayerImage& image) {
  std::vector<Aov> aovs;
  for (std::size_t part = 0; part < kIdRanks / 2; ++part) {
    aovs.push_back(
        {fmt::format("{}{:02}", kCryptomatteName, part), {"R", "G", "B", "A"}, false, 0, {}});
    render::PixelValues& values = aovs.back().values;
    values.assign(image.pixels() * 4, 0.0F);
    for (std::size_t pixel = 0; pixel < image.pixels(); ++pixel) {
      const float alpha = image.rgba[4 * pixel + 3];
      for (std::size_t rank = 0; rank < 2; ++rank) {
        const float* id = &image.ids[2 * kIdRanks * pixel + 2 * (2 * part + rank)];
        const float coverage = id[1] * alpha;
        if (!(coverage > 0)) continue;
        values[4 * pixel + 2 * rank] = id[0];
        values[4 * pixel + 2 * rank + 1] = coverage;
      }
    }
  }
  return aovs;
}

}  // namespace raystage::compose
