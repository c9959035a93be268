// SPDX-License-Identifier: Apache-2.0
// Unpacks any bytes as a packed frame, as raystage-transcode-jpeg does: what the frame states, then
// libjxl. A JPEG that results has the stated size, and is packed and unpacked to itself.
#include <cstdint>
#include <cstdlib>
#include <exception>
#include <optional>
#include <span>
#include <vector>

#include "store/jpegxl/packed_frame.h"
#include "store/jpegxl/transcoding.h"

namespace {

using namespace raystage::store;
constexpr std::uint64_t kMaxPixels = 64 * 64;
constexpr std::size_t kMaxJpeg = std::size_t{1} << 20;

std::optional<std::vector<std::byte>> reconstruct(std::span<const std::byte> packed,
                                                  std::size_t size) {
  try {
    return reconstruct_jpeg(packed, size, kMaxPixels);
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span packed(reinterpret_cast<const std::byte*>(data), size);
  const auto stated = read_jpeg_fixity(packed);
  if (stated && (!is_jpeg_xl(packed) || stated->size == 0 || stated->size > kMaxFrameBytes)) {
    std::abort();
  }
  // Damaged statements must not hide libjxl from the fuzzer.
  const std::size_t expected = stated && stated->size <= kMaxJpeg ? stated->size : 1000;
  const auto jpeg = reconstruct(packed, expected);
  if (!jpeg) return 0;
  if (jpeg->size() != expected) std::abort();
  try {
    const auto again = reconstruct(transcode_jpeg(*jpeg, 3), jpeg->size());
    if (!again || *again != *jpeg) std::abort();
  } catch (const std::exception&) {  // libjxl does not accept each JPEG that it reconstructs
  }
  return 0;
}
