// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as a JPEG frame: layout, full decoding, regions by a mask of the bytes,
// rewriting.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "base/error.h"
#include "store/jpeg/decode.h"
#include "store/jpeg/encode.h"
#include "store/jpeg/layout.h"

namespace {

using namespace raystage;

template <typename Body>
bool survives(const Body& body) {
  try {
    body();
    return true;
  } catch (const Error&) {
    return false;
  }
}

void require(bool condition) {
  if (!condition) std::abort();
}

void decode_region(std::span<const std::byte> jpeg, const store::JpegLayout& layout) {
  store::McuMask wanted(static_cast<std::size_t>(layout.mcu_count()));
  for (std::size_t i = 0; i < wanted.size(); ++i)
    wanted[i] = std::to_integer<std::uint8_t>(jpeg[i % jpeg.size()]) & 2;
  const store::LinearTable table{};
  std::vector<std::uint16_t> rgba(4 * static_cast<std::size_t>(layout.width) *
                                  static_cast<std::size_t>(layout.height));
  store::JpegDecoder().decode_region(jpeg, layout, wanted, table, rgba, "fuzz");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto jpeg = std::as_bytes(std::span(data, size));
  store::JpegLayout layout;
  if (!survives([&] { layout = store::parse_jpeg_layout(jpeg, "fuzz"); })) return 0;
  // Progressive JPEG may have hundreds of scans of the picture.
  const std::int64_t most_pixels = layout.baseline_ycc ? 1 << 20 : 1 << 15;
  if (std::int64_t{layout.width} * layout.height > most_pixels) return 0;
  require(layout.segment_offset.back() <= size);
  survives([&] { store::JpegDecoder().decode(jpeg, "fuzz"); });
  survives([&] { decode_region(jpeg, layout); });
  std::vector<std::byte> rewritten;
  const int interval = 1 + data[size / 2] % 9;
  if (!survives([&] { rewritten = store::add_restart_markers(jpeg, interval, "fuzz"); })) return 0;
  require(store::parse_jpeg_layout(rewritten, "fuzz").width == layout.width);
  return 0;
}
