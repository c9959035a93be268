// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as a timeline. If the first byte is odd, they are the decompressed contents, so
// that mutations pass the checksum of zstd.
#include <zstd.h>

#include <cstdint>
#include <cstdlib>
#include <vector>

#include "base/error.h"
#include "store/timeline_file.h"

namespace {

constexpr std::uint64_t kFingerprint = 1;
constexpr std::size_t kCameras = 2;

std::vector<std::byte> pack(std::span<const std::byte> payload) {
  std::vector<std::byte> file(ZSTD_compressBound(payload.size()));
  file.resize(ZSTD_compress(file.data(), file.size(), payload.data(), payload.size(), 1));
  return file;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const auto input = std::as_bytes(std::span(data, size)).subspan(1);
  const auto file = data[0] % 2 == 1 ? pack(input) : std::vector(input.begin(), input.end());
  raystage::store::Timeline timeline;
  try {
    timeline = raystage::store::decode_timeline(file, kFingerprint, kCameras, "timeline");
  } catch (const raystage::Error&) {
    return 0;
  }
  // A timeline that was read can be written and read again.
  if (timeline.ticks.empty()) return 0;
  const auto again = raystage::store::decode_timeline(
      raystage::store::encode_timeline(timeline, kFingerprint), kFingerprint, kCameras, "again");
  if (again.ticks.size() != timeline.ticks.size()) std::abort();
  if (!timeline.clocks.empty() && again.clocks != timeline.clocks) std::abort();
  return 0;
}
