// SPDX-License-Identifier: Apache-2.0
#include "render/depth/depth_file.h"

#include <zstd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <memory>
#include <new>
#include <string>

#include "schemas/error.h"
#include "store/little_endian.h"

namespace raystage {
namespace {

constexpr std::array<char, 8> kMagic{'R', 'A', 'Y', 'S', 'D', 'E', 'P', 'T'};
constexpr std::uint32_t kVersion = 1;
constexpr std::size_t kVersionAt = 8, kMapsAt = 12, kFingerprintAt = 16, kHeaderBytes = 24;
constexpr std::size_t kMapHeaderBytes = 12;
constexpr int kLevel = 3;
constexpr float kMostSteps = 65534;

/// The least power of two of which no depth is more than kMostSteps: exact in floats.
float step_of(const InverseDepthMap& map) {
  const float greatest = map.values.empty() ? 0.0F : *std::ranges::max_element(map.values);
  if (!(greatest > 0)) return 1;
  int exponent = 0;
  const float part = std::frexp(greatest / kMostSteps, &exponent);
  return std::ldexp(1.0F, part == 0.5F ? exponent - 1 : exponent);
}
/// 0: unknown; else 1 + the depth in steps.
std::uint16_t code_of(float depth, float step) {
  if (depth < 0) return 0;
  return static_cast<std::uint16_t>(1 + std::lround(std::min(depth / step, kMostSteps)));
}
float depth_of(std::uint16_t code, float step) {
  return code == 0 ? kUnknownDepth : static_cast<float>(code - 1) * step;
}

std::size_t bytes_of(const InverseDepthMap& map) { return kMapHeaderBytes + 2 * map.values.size(); }

}  // namespace

void quantise(InverseDepthMap& map) {
  const float step = step_of(map);
  for (float& depth : map.values) depth = depth_of(code_of(depth, step), step);
}

std::vector<std::byte> encode_depth_maps(std::span<const InverseDepthMap> maps,
                                         std::uint64_t fingerprint) {
  std::size_t bytes = kHeaderBytes;
  for (const InverseDepthMap& map : maps) bytes += bytes_of(map);
  std::vector<std::byte> payload(bytes);
  std::ranges::copy(std::as_bytes(std::span(kMagic)), payload.begin());
  store_little_endian(payload, kVersionAt, kVersion);
  store_little_endian(payload, kMapsAt, static_cast<std::uint32_t>(maps.size()));
  store_little_endian(payload, kFingerprintAt, fingerprint);
  std::size_t at = kHeaderBytes;
  for (const InverseDepthMap& map : maps) {
    const float step = step_of(map);
    store_little_endian(payload, at, static_cast<std::uint32_t>(map.width));
    store_little_endian(payload, at + 4, static_cast<std::uint32_t>(map.height));
    store_little_endian(payload, at + 8, std::bit_cast<std::uint32_t>(step));
    at += kMapHeaderBytes;
    std::uint16_t before = 0;  // differences along the rows are small, which compresses well
    for (const float depth : map.values) {
      const std::uint16_t code = code_of(depth, step);
      store_little_endian(payload, at, static_cast<std::uint16_t>(code - before));
      before = code;
      at += 2;
    }
  }
  struct Deleter {
    void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
  };
  const std::unique_ptr<ZSTD_CCtx, Deleter> context(ZSTD_createCCtx());
  if (!context) throw std::bad_alloc();
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, kLevel);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_checksumFlag, 1);
  std::vector<std::byte> file(ZSTD_compressBound(payload.size()));
  const std::size_t size =
      ZSTD_compress2(context.get(), file.data(), file.size(), payload.data(), payload.size());
  if (ZSTD_isError(size)) throw std::bad_alloc();  // the only way: the room is enough
  file.resize(size);
  return file;
}

std::vector<InverseDepthMap> decode_depth_maps(std::span<const std::byte> file,
                                               std::uint64_t fingerprint,
                                               std::span<const VirtualCamera> expected,
                                               std::string_view name) {
  const auto refuse = [&](const std::string& what) {
    return Error::bad_input(what, std::string(name), "Delete the file: depths are found anew");
  };
  std::size_t most = kHeaderBytes;
  for (const VirtualCamera& camera : expected) {
    most += kMapHeaderBytes +
            2 * static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  }
  std::vector<std::byte> payload(most);
  const std::size_t size =
      ZSTD_decompress(payload.data(), payload.size(), file.data(), file.size());
  if (ZSTD_isError(size) || size < kHeaderBytes ||
      !std::ranges::equal(std::span(payload).first<kMagic.size()>(),
                          std::as_bytes(std::span(kMagic)))) {
    throw refuse("the depths are damaged");
  }
  if (load_little_endian<std::uint32_t>(payload, kVersionAt) != kVersion) {
    throw refuse("the depths have another format version than this program's");
  }
  if (load_little_endian<std::uint64_t>(payload, kFingerprintAt) != fingerprint ||
      load_little_endian<std::uint32_t>(payload, kMapsAt) != expected.size()) {
    throw refuse("the depths are of other frames, another rig or other settings");
  }
  payload.resize(size);
  std::vector<InverseDepthMap> maps;
  std::size_t at = kHeaderBytes;
  for (const VirtualCamera& camera : expected) {
    if (payload.size() - at < kMapHeaderBytes) throw refuse("the depths are damaged");
    const auto width = load_little_endian<std::uint32_t>(payload, at);
    const auto height = load_little_endian<std::uint32_t>(payload, at + 4);
    const auto step = std::bit_cast<float>(load_little_endian<std::uint32_t>(payload, at + 8));
    at += kMapHeaderBytes;
    if (width == 0 && height == 0) {  // of an absent camera
      maps.emplace_back();
      continue;
    }
    const std::size_t pixels =
        static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
    if (width != static_cast<std::uint32_t>(camera.width) ||
        height != static_cast<std::uint32_t>(camera.height) || payload.size() - at < 2 * pixels ||
        !std::isfinite(step) || step <= 0) {
      throw refuse("the depths are damaged");
    }
    InverseDepthMap map{camera.width, camera.height, {}};
    map.values.reserve(pixels);
    std::uint16_t code = 0;
    for (std::size_t i = 0; i < pixels; ++i, at += 2) {
      code = static_cast<std::uint16_t>(code + load_little_endian<std::uint16_t>(payload, at));
      map.values.push_back(depth_of(code, step));
    }
    maps.push_back(std::move(map));
  }
  if (at != payload.size()) throw refuse("the depths are damaged");
  return maps;
}

}  // namespace raystage
