// SPDX-License-Identifier: Apache-2.0
// Kernels of EXR chunks: floats to halves by F. Giesen, "float->half variants" (the rounding of
// float addition rounds denormal halves), and the byte order and predictor of ZIP compression.
// Integer arithmetic and one addition: the same bytes at every instruction set. References:
// chunk_kernels_test.cpp. Cost: memory-bound.
#include "compose/exr/chunk_kernels.h"

#include <algorithm>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "compose/exr/chunk_kernels.cpp"
// The order of these includes matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage::compose {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using Floats = hn::ScalableTag<float>;
using Words = hn::Rebind<std::int32_t, Floats>;
using Halves = hn::Rebind<std::uint16_t, Floats>;
using Bytes = hn::ScalableTag<std::uint8_t>;

constexpr std::size_t kColors = 4;  // channels of the stride that is read by whole vectors

/// Returns the halves' bits in 32-bit lanes.
HWY_INLINE hn::Vec<Words> half_bits(hn::Vec<Floats> value) {
  const Floats d;
  const Words w;
  constexpr std::int32_t kLeastNormal = (127 - 14) << 23, kRebias = (127 - 15) << 23;
  const auto largest = hn::Set(d, 65504.0F), magic = hn::Set(d, 0.5F);
  const auto number = hn::IfThenElseZero(hn::Eq(value, value), value);
  const auto magnitude = hn::Min(hn::Abs(number), largest);
  const auto bits = hn::BitCast(w, magnitude);
  const auto odd = hn::And(hn::ShiftRight<13>(bits), hn::Set(w, 1));
  const auto normal = hn::ShiftRight<13>(hn::Add(hn::Sub(bits, hn::Set(w, kRebias - 0xfff)), odd));
  const auto denormal = hn::Sub(hn::BitCast(w, hn::Add(magnitude, magic)), hn::BitCast(w, magic));
  const auto unsigned_half =
      hn::IfThenElse(hn::Lt(bits, hn::Set(w, kLeastNormal)), denormal, normal);
  const auto sign = hn::And(hn::ShiftRight<16>(hn::BitCast(w, number)), hn::Set(w, 0x8000));
  return hn::Or(unsigned_half, sign);
}

/// Stores the first `count` lanes at bytes of any alignment.
template <class D>
HWY_INLINE void store_lanes(D d, hn::Vec<D> value, std::size_t count, std::uint8_t* to) {
  using T = hn::TFromD<D>;
  if (count == hn::Lanes(d)) return hn::StoreU(value, d, reinterpret_cast<T*>(to));
  HWY_ALIGN T lanes[hn::MaxLanes(D())];
  hn::Store(value, d, lanes);
  std::memcpy(to, lanes, count * sizeof(T));
}

/// Calls store(i, count, vector) with the values from i on, of which the first `count` are valid.
template <class Store>
HWY_INLINE void for_each_vector(const float* values, std::size_t stride, std::size_t count,
                                Store store) {
  const Floats d;
  const std::size_t lanes = hn::Lanes(d);
  std::size_t i = 0;
  HWY_ALIGN float buffer[hn::MaxLanes(Floats())];
  // Reads whole pixels; those of the last channels would be beyond the end.
  for (; stride == kColors && i + lanes < count; i += lanes) {
    hn::Vec<Floats> a, b, c, e;
    hn::LoadInterleaved4(d, values + i * kColors, a, b, c, e);
    store(i, lanes, a);
  }
  for (; stride == 1 && i + lanes <= count; i += lanes) store(i, lanes, hn::LoadU(d, values + i));
  for (; i < count; i += lanes) {
    const std::size_t here = std::min(lanes, count - i);
    for (std::size_t k = 0; k < lanes; ++k) buffer[k] = k < here ? values[(i + k) * stride] : 0;
    store(i, here, hn::Load(d, buffer));
  }
}

void to_halves(const float* values, std::size_t stride, std::size_t count, std::uint8_t* halves) {
  for_each_vector(values, stride, count,
                  [&](std::size_t i, std::size_t here, hn::Vec<Floats> value) HWY_ATTR {
                    const auto bits = hn::DemoteTo(Halves(), half_bits(value));
                    store_lanes(Halves(), bits, here, halves + 2 * i);
                  });
}

void copy_numbers(const float* values, std::size_t stride, std::size_t count, float replacement,
                  std::uint8_t* copies) {
  const Floats d;
  for_each_vector(
      values, stride, count, [&](std::size_t i, std::size_t here, hn::Vec<Floats> value) HWY_ATTR {
        const auto number = hn::IfThenElse(hn::Eq(value, value), value, hn::Set(d, replacement));
        store_lanes(d, number, here, copies + 4 * i);
      });
}

void predict(const std::uint8_t* raw, std::size_t size, std::uint8_t* sorted,
             std::uint8_t* predicted) {
  const Bytes d;
  const std::size_t lanes = hn::Lanes(d), half = (size + 1) / 2;
  std::size_t i = 0;
  for (; 2 * (i + lanes) <= size; i += lanes) {
    hn::Vec<Bytes> even, odd;
    hn::LoadInterleaved2(d, raw + 2 * i, even, odd);
    hn::StoreU(even, d, sorted + i);
    hn::StoreU(odd, d, sorted + half + i);
  }
  for (; 2 * i < size; ++i) {
    sorted[i] = raw[2 * i];
    if (2 * i + 1 < size) sorted[half + i] = raw[2 * i + 1];
  }
  if (size == 0) return;
  predicted[0] = sorted[0];
  std::size_t k = 1;
  for (; k + lanes <= size; k += lanes) {
    hn::StoreU(
        hn::Add(hn::Sub(hn::LoadU(d, sorted + k), hn::LoadU(d, sorted + k - 1)), hn::Set(d, 128)),
        d, predicted + k);
  }
  for (; k < size; ++k) predicted[k] = static_cast<std::uint8_t>(sorted[k] - sorted[k - 1] + 128);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage::compose
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::compose {

HWY_EXPORT(to_halves);
HWY_EXPORT(copy_numbers);
HWY_EXPORT(predict);

void convert_to_halves(const float* values, std::size_t stride, std::size_t count,
                       std::uint8_t* halves) {
  HWY_DYNAMIC_DISPATCH(to_halves)(values, stride, count, halves);
}
void copy_without_nan(const float* values, std::size_t stride, std::size_t count,
                      float nan_replacement, std::uint8_t* copies) {
  HWY_DYNAMIC_DISPATCH(copy_numbers)(values, stride, count, nan_replacement, copies);
}
void predict_chunk(std::span<const std::uint8_t> raw, std::span<std::uint8_t> sorted,
                   std::span<std::uint8_t> predicted) {
  HWY_DYNAMIC_DISPATCH(predict)(raw.data(), raw.size(), sorted.data(), predicted.data());
}

}  // namespace raystage::compose
#endif
