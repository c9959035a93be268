// SPDX-License-Identifier: Apache-2.0
// Joins the rows of wanted MCUs to ranges of memory, across gaps of less than kGap bytes, and
// requests each with one madvise(). Cost: O(rows + pages).
#include "store/processing/frames/frame_pages.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>

namespace raystage::store {
namespace {

constexpr std::size_t kGap = 8192;  // a call costs as much as a few pages

void request(std::uintptr_t begin, std::uintptr_t end) {
#ifdef MADV_POPULATE_WRITE
  static const auto page = static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
  begin -= begin % page;
  // Failure is harmless: older kernels do not support it, and pages come at their first access.
  madvise(reinterpret_cast<void*>(begin), end - begin, MADV_POPULATE_WRITE);  // NOLINT
#endif
}

}  // namespace

void request_pages(std::span<std::uint16_t> rgba, const JpegLayout& layout, const McuMask& wanted) {
  const auto base = reinterpret_cast<std::uintptr_t>(rgba.data());  // NOLINT: pages are addresses
  const std::size_t pixel_bytes = 4 * sizeof(std::uint16_t);
  if (wanted.empty()) {
    if (!rgba.empty()) request(base, base + rgba.size_bytes());
    return;
  }
  std::uintptr_t begin = 0, end = 0;  // of the range that is not requested yet
  for (int y = 0; y < layout.height; ++y) {
    const auto row =
        wanted.begin() + static_cast<std::ptrdiff_t>(y / layout.mcu_height) * layout.mcus_per_row;
    const auto row_end = row + layout.mcus_per_row;
    const auto is_wanted = [](std::uint8_t mcu) { return mcu != 0; };
    for (auto first = std::find_if(row, row_end, is_wanted); first != row_end;) {
      const auto last = std::find(first, row_end, std::uint8_t{0});
      const auto left = static_cast<std::size_t>(first - row) * layout.mcu_width;
      const auto right = std::min(static_cast<std::size_t>(last - row) * layout.mcu_width,
                                  static_cast<std::size_t>(layout.width));
      const std::uintptr_t row_begin =
          base + static_cast<std::size_t>(y) * layout.width * pixel_bytes;
      if (row_begin + left * pixel_bytes > end + kGap) {
        if (end > begin) request(begin, end);
        begin = row_begin + left * pixel_bytes;
      }
      end = row_begin + right * pixel_bytes;
      first = std::find_if(last, row_end, is_wanted);
    }
  }
  if (end > begin) request(begin, end);
}

}  // namespace raystage::store
