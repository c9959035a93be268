// SPDX-License-Identifier: Apache-2.0
// Upsamples chroma rows by 2 with a triangle filter, bit for bit as libjpeg-turbo's smooth
// upsampling (jdsample.c), or by replication. Cost: O(pixels). The tests compare it with libjpeg-
// turbo.
#include "store/jpeg/upsampling.h"

#include <algorithm>
#include <bit>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "store/jpeg/upsampling.cpp"
// foreach_target.h must come first.
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage::store {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// All of these work on whole vectors and write past `count`.
constexpr hn::ScalableTag<std::uint16_t> kShort;
constexpr hn::Rebind<std::uint8_t, decltype(kShort)> kByte;
using Short = hn::Vec<decltype(kShort)>;

HWY_INLINE Short widen(const std::uint8_t* samples) {
  return hn::PromoteTo(kShort, hn::LoadU(kByte, samples));
}
HWY_INLINE Short times3(Short a) { return hn::Add(a, hn::Add(a, a)); }

// Two adjacent bytes in memory.
static_assert(std::endian::native == std::endian::little);
HWY_INLINE void store_pairs(Short first, Short second, std::uint8_t* out) {
  const Short pairs = hn::Or(first, hn::ShiftLeft<8>(second));
#if HWY_TARGET == HWY_SCALAR
  const std::uint16_t pair = hn::GetLane(pairs);
  std::memcpy(out, &pair, sizeof(pair));
#else
  constexpr hn::Repartition<std::uint8_t, decltype(kShort)> kBytes;
  hn::StoreU(hn::BitCast(kBytes, pairs), kBytes, out);
#endif
}

// Upsamples samples begin..end - 1 to two pixels each, from the sample and its left and right
// neighbours.
void AcrossRow(const std::uint8_t* samples, int begin, int end, std::uint8_t* out) {
  const int lanes = static_cast<int>(hn::Lanes(kShort));
  for (int i = begin; i < end; i += lanes, out += 2 * lanes) {
    const Short middle = times3(widen(samples + i));
    const Short left = hn::Add(hn::Add(middle, widen(samples + i - 1)), hn::Set(kShort, 1));
    const Short right = hn::Add(hn::Add(middle, widen(samples + i + 1)), hn::Set(kShort, 2));
    store_pairs(hn::ShiftRight<2>(left), hn::ShiftRight<2>(right), out);
  }
}

void AcrossBothRows(const std::uint8_t* near, const std::uint8_t* far, int begin, int end,
                    std::uint8_t* out) {
  const int lanes = static_cast<int>(hn::Lanes(kShort));
  const auto sum = [&](int i) { return hn::Add(times3(widen(near + i)), widen(far + i)); };
  for (int i = begin; i < end; i += lanes, out += 2 * lanes) {
    const Short middle = times3(sum(i));
    const Short left = hn::Add(hn::Add(middle, sum(i - 1)), hn::Set(kShort, 8));
    const Short right = hn::Add(hn::Add(middle, sum(i + 1)), hn::Set(kShort, 7));
    store_pairs(hn::ShiftRight<4>(left), hn::ShiftRight<4>(right), out);
  }
}

// Upsamples samples begin..end - 1 to one pixel each. `bias`: 1 for the upper row of two, 2 for the
// lower.
void BetweenRows(const std::uint8_t* near, const std::uint8_t* far, int begin, int end, int bias,
                 std::uint8_t* out) {
  const int lanes = static_cast<int>(hn::Lanes(kShort));
  const Short rounding = hn::Set(kShort, static_cast<std::uint16_t>(bias));
  for (int i = begin; i < end; i += lanes, out += lanes) {
    const Short sum = hn::Add(hn::Add(times3(widen(near + i)), widen(far + i)), rounding);
    const auto signed_sum =
        hn::BitCast(hn::RebindToSigned<decltype(kShort)>(), hn::ShiftRight<2>(sum));
    hn::StoreU(hn::DemoteTo(kByte, signed_sum), kByte, out);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace raystage::store
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::store {
namespace {

HWY_EXPORT(AcrossRow);
HWY_EXPORT(AcrossBothRows);
HWY_EXPORT(BetweenRows);

std::uint8_t byte_of(int value) { return static_cast<std::uint8_t>(value); }

// Writes the pixels of samples first..last - 1; samples at the ends of a row of `width` have one
// neighbour.
void across_row(const std::uint8_t* samples, int width, int first, int last, std::uint8_t* out) {
  const int inner = std::max(first, 1), end = width - 1;
  HWY_DYNAMIC_DISPATCH(AcrossRow)
  (samples, inner, std::min(last, end), out + 2 * (inner - first));
  if (first == 0) {
    out[0] = samples[0];
    out[1] = byte_of((3 * samples[0] + samples[1] + 2) >> 2);
  }
  if (last > end) {
    out[2 * (end - first)] = byte_of((3 * samples[end] + samples[end - 1] + 1) >> 2);
    out[2 * (end - first) + 1] = samples[end];
  }
}

void across_both_rows(const std::uint8_t* near, const std::uint8_t* far, int width, int first,
                      int last, std::uint8_t* out) {
  const int inner = std::max(first, 1), end = width - 1;
  const auto sum = [&](int i) { return 3 * near[i] + far[i]; };
  HWY_DYNAMIC_DISPATCH(AcrossBothRows)
  (near, far, inner, std::min(last, end), out + 2 * (inner - first));
  if (first == 0) {
    out[0] = byte_of((4 * sum(0) + 8) >> 4);
    out[1] = byte_of((3 * sum(0) + sum(1) + 7) >> 4);
  }
  if (last > end) {
    out[2 * (end - first)] = byte_of((3 * sum(end) + sum(end - 1) + 8) >> 4);
    out[2 * (end - first) + 1] = byte_of((4 * sum(end) + 7) >> 4);
  }
}

}  // namespace

Upsampler::Upsampler(const JpegLayout& layout, const Plane& plane, int component)
    : plane_(plane),
      h_(layout.mcu_width / 8 / layout.h[component]),
      v_(layout.mcu_height / 8 / layout.v[component]),
      smooth_x_(h_ == 2 && v_ <= 2 && plane.width > 2),
      smooth_y_(v_ == 2 && (h_ == 1 || smooth_x_)) {}

const std::uint8_t* Upsampler::row(int y, int begin, int end, std::uint8_t* buffer) const {
  if (h_ == 1 && v_ == 1) return plane_.row(y) + begin;
  const bool upper = y % 2 == 0;
  const int middle = y / v_,
            other = std::clamp(upper ? middle - 1 : middle + 1, 0, plane_.height - 1);
  const std::uint8_t* const near = plane_.row(middle);
  const std::uint8_t* const far = plane_.row(other);
  if (smooth_x_ && smooth_y_) {
    across_both_rows(near, far, plane_.width, begin / 2, (end + 1) / 2, buffer);
  } else if (smooth_x_) {
    across_row(near, plane_.width, begin / 2, (end + 1) / 2, buffer);
  } else if (smooth_y_) {
    HWY_DYNAMIC_DISPATCH(BetweenRows)(near, far, begin, end, upper ? 1 : 2, buffer);
  } else {
    for (int x = begin; x < end; ++x) buffer[x - begin] = near[x / h_];
  }
  return buffer;
}

}  // namespace raystage::store
#endif
