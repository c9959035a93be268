// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as stored depth maps. If the first byte is odd, they are the decompressed
// contents, so that mutations pass the checksum of zstd.
#include <zstd.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "base/error.h"
#include "render/depth/depth_file.h"

namespace {

constexpr std::uint64_t kFingerprint = 1;

std::vector<std::byte> pack(std::span<const std::byte> payload) {
  std::vector<std::byte> file(ZSTD_compressBound(payload.size()));
  file.resize(ZSTD_compress(file.data(), file.size(), payload.data(), payload.size(), 1));
  return file;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  std::vector<raystage::render::VirtualCamera> cameras(2);
  for (raystage::render::VirtualCamera& camera : cameras) {
    camera.width = 4;
    camera.height = 3;
  }
  const auto input = std::as_bytes(std::span(data, size)).subspan(1);
  const auto file = data[0] % 2 == 1 ? pack(input) : std::vector(input.begin(), input.end());
  std::vector<raystage::render::InverseDepthMap> maps;
  try {
    maps = raystage::render::decode_depth_maps(file, kFingerprint, cameras, "depths");
  } catch (const raystage::Error&) {
    return 0;
  }
  for (const raystage::render::InverseDepthMap& map : maps) {
    for (const float depth : map.values) {
      if (!std::isfinite(depth)) std::abort();
    }
  }
  // Depth maps that were read can be written and read again.
  for (raystage::render::InverseDepthMap& map : maps) raystage::render::quantise_depths(map);
  std::vector<std::byte> written;
  raystage::render::encode_depth_maps(maps, kFingerprint, [&](std::span<const std::byte> block) {
    written.insert(written.end(), block.begin(), block.end());
  });
  const auto again = raystage::render::decode_depth_maps(written, kFingerprint, cameras, "again");
  if (again.size() != maps.size()) std::abort();
  for (std::size_t i = 0; i < maps.size(); ++i) {
    if (again[i].values != maps[i].values) std::abort();
  }
  return 0;
}
