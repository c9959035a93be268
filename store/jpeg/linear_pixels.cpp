// SPDX-License-Identifier: Apache-2.0
#include "store/jpeg/linear_pixels.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "store/jpeg/linear_pixels.cpp"
// foreach_target.h must come first.
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr hn::ScalableTag<std::int32_t> kInt;
constexpr hn::Rebind<std::uint8_t, decltype(kInt)> kByte;
using Int = hn::Vec<decltype(kInt)>;

HWY_INLINE Int widen(const std::uint8_t* samples) {
  return hn::PromoteTo(kInt, hn::LoadU(kByte, samples));
}

// Rows are padded: whole vectors are written past `count`.
//
// libjpeg's fixed point (jdcolor.c): 16 bits of fraction, halves rounded up.
void YccToRgb(const std::uint8_t* y, const std::uint8_t* cb, const std::uint8_t* cr,
              std::size_t count, std::uint8_t* red, std::uint8_t* green, std::uint8_t* blue) {
  const Int half = hn::Set(kInt, 32768), middle = hn::Set(kInt, 128);
  for (std::size_t i = 0; i < count; i += hn::Lanes(kInt)) {
    const Int luma = widen(y + i);
    const Int u = hn::Sub(widen(cb + i), middle), v = hn::Sub(widen(cr + i), middle);
    const Int r = hn::Add(hn::Mul(v, hn::Set(kInt, 91881)), half);
    const Int g =
        hn::Sub(half, hn::Add(hn::Mul(u, hn::Set(kInt, 22554)), hn::Mul(v, hn::Set(kInt, 46802))));
    const Int b = hn::Add(hn::Mul(u, hn::Set(kInt, 116130)), half);
    hn::StoreU(hn::DemoteTo(kByte, hn::Add(luma, hn::ShiftRight<16>(r))), kByte, red + i);
    hn::StoreU(hn::DemoteTo(kByte, hn::Add(luma, hn::ShiftRight<16>(g))), kByte, green + i);
    hn::StoreU(hn::DemoteTo(kByte, hn::Add(luma, hn::ShiftRight<16>(b))), kByte, blue + i);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace raystage
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage {

HWY_EXPORT(YccToRgb);

namespace {

// Pixels converted at a time: short enough to stay in the first cache.
constexpr std::size_t kChunk = 512;
constexpr std::size_t kPadding = 64;  // whole vectors are read and written
using Chunk = std::array<std::uint8_t, kChunk + kPadding>;

// One channel's codes as 16 bits at their place in a pixel of four.
using PixelTable = std::array<std::array<std::uint64_t, 256>, 3>;

PixelTable pixel_table(const LinearTable& table) {
  PixelTable pixels;
  for (std::size_t c = 0; c < 3; ++c) {
    const std::size_t place = std::endian::native == std::endian::little ? c : 3 - c;
    const std::uint64_t opaque =
        std::endian::native == std::endian::little ? 0xFFFFull << 48 : 0xFFFF;
    for (std::size_t code = 0; code < 256; ++code)
      pixels[c][code] = std::uint64_t{table.code[c][code]} << (16 * place) | opaque;
  }
  return pixels;
}

void look_up(const PixelTable& table, const std::uint8_t* red, const std::uint8_t* green,
             const std::uint8_t* blue, std::size_t count, std::uint16_t* pixels) {
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t pixel = table[0][red[i]] | table[1][green[i]] | table[2][blue[i]];
    std::memcpy(pixels + 4 * i, &pixel, sizeof(pixel));
  }
}

// How libjpeg-turbo brings a component to full resolution (jdsample.c). x and y are of the picture.
class Upsampler {
 public:
  Upsampler(const JpegLayout& layout, const Plane& plane, int component, std::uint8_t* row)
      : plane_(plane),
        row_(row),
        h_(layout.mcu_width / 8 / layout.h[component]),
        v_(layout.mcu_height / 8 / layout.v[component]) {
    smooth_x_ = h_ == 2 && v_ <= 2 && plane.width > 2;
    smooth_y_ = v_ == 2 && (h_ == 1 || smooth_x_);
  }

  // The samples of pixels begin..end - 1 of row y; the first is at [0].
  const std::uint8_t* row(int y, int begin, int end) {
    if (h_ == 1 && v_ == 1) return plane_.row(y) + begin;
    const int middle = y / v_;
    const int other = std::clamp(y % 2 == 0 ? middle - 1 : middle + 1, 0, plane_.height - 1);
    const std::uint8_t* near = plane_.row(middle);
    const std::uint8_t* far = plane_.row(other);
    if (smooth_x_ && smooth_y_) {
      both_ways(near, far, begin, end);
    } else if (smooth_x_) {
      across(near, begin, end);
    } else if (smooth_y_) {
      const int bias = y % 2 == 0 ? 1 : 2;
      for (int x = begin; x < end; ++x)
        row_[x - begin] = static_cast<std::uint8_t>((3 * near[x] + far[x] + bias) >> 2);
    } else {
      for (int x = begin; x < end; ++x) row_[x - begin] = near[x / h_];
    }
    return row_;
  }

 private:
  // Triangle filter: 3/4 of the nearer sample, 1/4 of the next. `begin` is even.
  void across(const std::uint8_t* samples, int begin, int end) {
    const int first = begin / 2, last = (end + 1) / 2;
    std::uint8_t* out = row_;
    for (int i = std::max(first, 1); i < std::min(last, plane_.width - 1); ++i) {
      std::uint8_t* const two = out + 2 * (i - first);
      two[0] = static_cast<std::uint8_t>((3 * samples[i] + samples[i - 1] + 1) >> 2);
      two[1] = static_cast<std::uint8_t>((3 * samples[i] + samples[i + 1] + 2) >> 2);
    }
    if (first == 0) {
      out[0] = samples[0];
      out[1] = static_cast<std::uint8_t>((3 * samples[0] + samples[1] + 2) >> 2);
    }
    if (const int i = plane_.width - 1; last > i) {
      std::uint8_t* const two = out + 2 * (i - first);
      two[0] = static_cast<std::uint8_t>((3 * samples[i] + samples[i - 1] + 1) >> 2);
      two[1] = samples[i];
    }
  }

  void both_ways(const std::uint8_t* near, const std::uint8_t* far, int begin, int end) {
    const int first = begin / 2, last = (end + 1) / 2;
    std::uint8_t* out = row_;
    const auto sum = [&](int i) { return 3 * near[i] + far[i]; };
    for (int i = std::max(first, 1); i < std::min(last, plane_.width - 1); ++i) {
      std::uint8_t* const two = out + 2 * (i - first);
      two[0] = static_cast<std::uint8_t>((3 * sum(i) + sum(i - 1) + 8) >> 4);
      two[1] = static_cast<std::uint8_t>((3 * sum(i) + sum(i + 1) + 7) >> 4);
    }
    if (first == 0) {
      out[0] = static_cast<std::uint8_t>((4 * sum(0) + 8) >> 4);
      out[1] = static_cast<std::uint8_t>((3 * sum(0) + sum(1) + 7) >> 4);
    }
    if (const int i = plane_.width - 1; last > i) {
      std::uint8_t* const two = out + 2 * (i - first);
      two[0] = static_cast<std::uint8_t>((3 * sum(i) + sum(i - 1) + 8) >> 4);
      two[1] = static_cast<std::uint8_t>((4 * sum(i) + 7) >> 4);
    }
  }

  const Plane& plane_;
  std::uint8_t* row_;
  int h_, v_;  ///< picture pixels per sample
  bool smooth_x_, smooth_y_;
};

}  // namespace

void convert_to_linear(const ScanDecoder& scan, const JpegLayout& layout,
                       std::span<const std::uint8_t> wanted, const LinearTable& table,
                       std::span<std::uint16_t> rgbx_linear) {
  const PixelTable pixels = pixel_table(table);
  Chunk upsampled[3], rgb[3];
  const auto upsampler = [&](int c) {
    return Upsampler(layout, scan.plane(c), c, upsampled[c].data());
  };
  const int colors = layout.components == 3 ? 1 : 0;
  Upsampler luma = upsampler(0), blue = upsampler(colors), red = upsampler(2 * colors);
  const auto convert_run = [&](int y, int begin, int end) {
    std::uint16_t* const out =
        rgbx_linear.data() +
        4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(layout.width) +
             static_cast<std::size_t>(begin));
    const auto count = static_cast<std::size_t>(end - begin);
    const std::uint8_t* const lumas = luma.row(y, begin, end);
    if (colors == 0) return look_up(pixels, lumas, lumas, lumas, count, out);
    HWY_DYNAMIC_DISPATCH(YccToRgb)
    (lumas, blue.row(y, begin, end), red.row(y, begin, end), count, rgb[0].data(), rgb[1].data(),
     rgb[2].data());
    look_up(pixels, rgb[0].data(), rgb[1].data(), rgb[2].data(), count, out);
  };
  const int mcus_per_chunk = static_cast<int>(kChunk) / layout.mcu_width;
  for (int row = 0; row < layout.mcu_rows; ++row) {
    const auto mine = wanted.subspan(static_cast<std::size_t>(row * layout.mcus_per_row),
                                     static_cast<std::size_t>(layout.mcus_per_row));
    for (int first = 0; first < layout.mcus_per_row;) {
      if (!mine[static_cast<std::size_t>(first)]) {
        ++first;
        continue;
      }
      int end = first + 1;
      while (end < layout.mcus_per_row && end - first < mcus_per_chunk &&
             mine[static_cast<std::size_t>(end)])
        ++end;
      const int bottom = std::min((row + 1) * layout.mcu_height, layout.height);
      for (int y = row * layout.mcu_height; y < bottom; ++y)
        convert_run(y, first * layout.mcu_width, std::min(end * layout.mcu_width, layout.width));
      first = end;
    }
  }
}

}  // namespace raystage
#endif
