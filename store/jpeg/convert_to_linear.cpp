// SPDX-License-Identifier: Apache-2.0
// Converts wanted MCUs of decoded YCbCr planes to RGB and looks the codes up in a table of linear
// light, a row of pixels at a time. The result equals, bit for bit, libjpeg-turbo's full decode
// followed by the table; the tests compare with it. Cost: O(pixels).
#include "store/jpeg/convert_to_linear.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "store/jpeg/upsampling.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "store/jpeg/convert_to_linear.cpp"
// foreach_target.h must come first.
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

// The fixed point of libjpeg (jdcolor.c): 16 fraction bits, halves rounded up, u and v centred:
//   R = Y + (91881 v + 32768 >> 16)
//   G = Y + (32768 - 22554 u - 46802 v >> 16)
//   B = Y + (116130 u + 32768 >> 16)
// Reads and writes whole vectors, past `count`.
HWY_BEFORE_NAMESPACE();
namespace raystage::store {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_SCALAR

void YccToRgb(const std::uint8_t* y, const std::uint8_t* cb, const std::uint8_t* cr,
              std::size_t count, std::uint8_t* red, std::uint8_t* green, std::uint8_t* blue) {
  const auto limit = [](int value) { return static_cast<std::uint8_t>(std::clamp(value, 0, 255)); };
  for (std::size_t i = 0; i < count; ++i) {
    const int u = cb[i] - 128, v = cr[i] - 128;
    red[i] = limit(y[i] + ((91881 * v + 32768) >> 16));
    green[i] = limit(y[i] + ((32768 - 22554 * u - 46802 * v) >> 16));
    blue[i] = limit(y[i] + ((116130 * u + 32768) >> 16));
  }
}

#else

constexpr hn::ScalableTag<std::int16_t> kShort;
constexpr hn::Repartition<std::int32_t, decltype(kShort)> kInt;
constexpr hn::Rebind<std::uint8_t, decltype(kShort)> kByte;
using Short = hn::Vec<decltype(kShort)>;

HWY_INLINE Short widen(const std::uint8_t* samples) {
  return hn::PromoteTo(kShort, hn::LoadU(kByte, samples));
}

// Returns (factor * a + 32768) >> 16 for |a| <= 16383: twice the high half, then halved with
// rounding.
HWY_INLINE Short multiply(Short a, int factor) {
  const Short high = hn::MulHigh(hn::Add(a, a), hn::Set(kShort, static_cast<std::int16_t>(factor)));
  return hn::ShiftRight<1>(hn::Add(high, hn::Set(kShort, 1)));
}

// Returns (32768 - 22554 u + 18734 v) >> 16 of the pairs u, v.
HWY_INLINE hn::Vec<decltype(kInt)> green_pairs(Short uv) {
  const std::int32_t factors = 18734 * 65536 + (65536 - 22554);
  auto odd = hn::Zero(kInt);
  const auto sum = hn::ReorderWidenMulAccumulate(
      kInt, uv, hn::BitCast(kShort, hn::Set(kInt, factors)), hn::Set(kInt, 32768), odd);
  return hn::ShiftRight<16>(hn::RearrangeToOddPlusEven(sum, odd));
}

void YccToRgb(const std::uint8_t* y, const std::uint8_t* cb, const std::uint8_t* cr,
              std::size_t count, std::uint8_t* red, std::uint8_t* green, std::uint8_t* blue) {
  const Short middle = hn::Set(kShort, 128);
  for (std::size_t i = 0; i < count; i += hn::Lanes(kShort)) {
    const Short luma = widen(y + i);
    const Short u = hn::Sub(widen(cb + i), middle), v = hn::Sub(widen(cr + i), middle);
    // 91881 = 65536 + 26345, 116130 = 2 * 65536 - 14942, -46802 = 18734 - 65536
    const Short r = hn::Add(hn::Add(luma, v), multiply(v, 26345));
    const Short b = hn::Add(hn::Add(luma, hn::Add(u, u)), multiply(u, -14942));
    const Short g = hn::ReorderDemote2To(kShort, green_pairs(hn::InterleaveLower(kShort, u, v)),
                                         green_pairs(hn::InterleaveUpper(kShort, u, v)));
    hn::StoreU(hn::DemoteTo(kByte, r), kByte, red + i);
    hn::StoreU(hn::DemoteTo(kByte, hn::Add(hn::Sub(luma, v), g)), kByte, green + i);
    hn::StoreU(hn::DemoteTo(kByte, b), kByte, blue + i);
  }
}

#endif  // HWY_TARGET == HWY_SCALAR

}  // namespace HWY_NAMESPACE
}  // namespace raystage::store
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::store {
namespace {

HWY_EXPORT(YccToRgb);

// Pixels per chunk: it fits into the L1 cache.
constexpr std::size_t kChunk = 512;
using Chunk = std::array<std::uint8_t, kChunk + Upsampler::kPadding>;

// The 16 bits of each channel at its position in a pixel of four.
using PixelTable = std::array<std::array<std::uint64_t, 256>, 3>;

static_assert(std::endian::native == std::endian::little);
PixelTable pixel_table(const LinearTable& table) {
  PixelTable pixels;
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t code = 0; code < 256; ++code)
      pixels[c][code] = std::uint64_t{table.code[c][code]} << (16 * c) | std::uint64_t{65535} << 48;
  return pixels;
}

void look_up(const PixelTable& table, const std::uint8_t* red, const std::uint8_t* green,
             const std::uint8_t* blue, std::size_t count, std::uint16_t* pixels) {
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t pixel = table[0][red[i]] | table[1][green[i]] | table[2][blue[i]];
    std::memcpy(pixels + 4 * i, &pixel, sizeof(pixel));
  }
}

// Converts pixels of one row, at most kChunk of them.
class RowConverter {
 public:
  RowConverter(const ScanDecoder& scan, const JpegLayout& layout, const LinearTable& table)
      : table_(pixel_table(table)),
        colors_(layout.components == 3),
        luma_(layout, scan.plane(0), 0),
        cb_(layout, scan.plane(colors_ ? 1 : 0), colors_ ? 1 : 0),
        cr_(layout, scan.plane(colors_ ? 2 : 0), colors_ ? 2 : 0) {}

  void convert(int y, int begin, int end, std::uint16_t* out) {
    const auto count = static_cast<std::size_t>(end - begin);
    const std::uint8_t* const luma = luma_.row(y, begin, end, samples_[0].data());
    if (!colors_) {
      look_up(table_, luma, luma, luma, count, out);
      return;
    }
    const std::uint8_t* const cb = cb_.row(y, begin, end, samples_[1].data());
    const std::uint8_t* const cr = cr_.row(y, begin, end, samples_[2].data());
    HWY_DYNAMIC_DISPATCH(YccToRgb)
    (luma, cb, cr, count, rgb_[0].data(), rgb_[1].data(), rgb_[2].data());
    look_up(table_, rgb_[0].data(), rgb_[1].data(), rgb_[2].data(), count, out);
  }

 private:
  PixelTable table_;
  bool colors_;
  Upsampler luma_, cb_, cr_;
  Chunk samples_[3], rgb_[3];
};

}  // namespace

void convert_to_linear(const ScanDecoder& scan, const JpegLayout& layout,
                       std::span<const std::uint8_t> wanted, const LinearTable& table,
                       std::span<std::uint16_t> rgba_linear) {
  RowConverter rows(scan, layout, table);
  const int longest = static_cast<int>(kChunk) / layout.mcu_width;
  const auto width = static_cast<std::size_t>(layout.width);
  for (int row = 0; row < layout.mcu_rows; ++row) {
    const std::uint8_t* const mine =
        wanted.data() + static_cast<std::ptrdiff_t>(row) * layout.mcus_per_row;
    const int top = row * layout.mcu_height;
    const int bottom = std::min(top + layout.mcu_height, layout.height);
    for (int first = 0; first < layout.mcus_per_row;) {
      int end = first;
      while (end < layout.mcus_per_row && end - first < longest && mine[end] != 0) ++end;
      if (end == first) {
        ++first;
        continue;
      }
      const int left = first * layout.mcu_width;
      const int right = std::min(end * layout.mcu_width, layout.width);
      for (int y = top; y < bottom; ++y)
        rows.convert(y, left, right,
                     &rgba_linear[4 * (static_cast<std::size_t>(y) * width +
                                       static_cast<std::size_t>(left))]);
      first = end;
    }
  }
}

}  // namespace raystage::store
#endif
