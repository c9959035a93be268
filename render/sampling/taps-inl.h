// SPDX-License-Identifier: Apache-2.0
// Where a camera is sampled for a run of pixels, and the samples, in vectors. Included once per
// instruction set, as Highway's kernels are: no include guard of the common kind.

#if defined(RAYSTAGE_RENDER_SAMPLING_TAPS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYSTAGE_RENDER_SAMPLING_TAPS_INL_H
#undef RAYSTAGE_RENDER_SAMPLING_TAPS_INL_H
#else
#define RAYSTAGE_RENDER_SAMPLING_TAPS_INL_H
#endif

// The order matters.
// clang-format off
#include <hwy/cache_control.h>
#include <hwy/highway.h>
#include "render/sampling/lens-inl.h"
#include "render/sampling/roots-inl.h"
// clang-format on

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "render/sampling/source_view.h"

HWY_BEFORE_NAMESPACE();
namespace raystage {
namespace HWY_NAMESPACE {

/// Pixels worked on at once: positions are vectors across them, then samples vectors across taps
/// and colours.
constexpr int kChunk = 128;

/// For each pixel of a chunk: the upper left of four neighbours, counted through the frame, and the
/// weights of upper left, upper right, lower left, lower right (interpolation times the camera's
/// share of the ray). The weights stand in the order of transpose_blocks(): see slot_of().
struct Taps {
  HWY_ALIGN std::int32_t pixel[kChunk];
  HWY_ALIGN float weight[4 * kChunk];
};

/// Four vectors of one quantity each become four vectors of whole pixels, and back: 4 x 4 values
/// within every 128 bits. Values never leave their 128 bits, which is what makes it cheap, and why
/// the pixels come out in an order of their own.
template <class D, class V>
HWY_INLINE void transpose_blocks(D d, V& v0, V& v1, V& v2, V& v3) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::Repartition<std::uint64_t, D> pairs;
  const auto low01 = hn::BitCast(pairs, hn::InterleaveLower(d, v0, v1));
  const auto low23 = hn::BitCast(pairs, hn::InterleaveLower(d, v2, v3));
  const auto high01 = hn::BitCast(pairs, hn::InterleaveUpper(d, v0, v1));
  const auto high23 = hn::BitCast(pairs, hn::InterleaveUpper(d, v2, v3));
  v0 = hn::BitCast(d, hn::InterleaveLower(pairs, low01, low23));
  v1 = hn::BitCast(d, hn::InterleaveUpper(pairs, low01, low23));
  v2 = hn::BitCast(d, hn::InterleaveLower(pairs, high01, high23));
  v3 = hn::BitCast(d, hn::InterleaveUpper(pairs, high01, high23));
}

/// Where transpose_blocks() puts pixel i of a chunk.
template <class D>
HWY_INLINE int slot_of(D d, int i) {
  const int lanes = static_cast<int>(hwy::HWY_NAMESPACE::Lanes(d));
  const int within = i % lanes;
  return i - within + within % 4 * (lanes / 4) + within / 4;
}

/// The pixel of a chunk of n where a linear function is nearest to 0, counted from its first. From
/// there its values are exact to a few units in their own last place, however much larger they are
/// elsewhere in the chunk.
inline int anchor_of(const double* function, int begin, int y, int n) {
  if (function[0] == 0) return 0;
  const double at_begin = function[0] * (begin + 0.5) + (function[1] * (y + 0.5) + function[2]);
  return static_cast<int>(std::clamp(std::round(-at_begin / function[0]), 0.0, n - 1.0));
}

/// A linear function of the pixel: `base` at pixel `start` of the chunk, found in double, and the
/// short way from there in float.
struct Ramp {
  float base, step;
  int start;
};
HWY_INLINE Ramp ramp(const double* function, int begin, int start, int y, double scale) {
  const double x = begin + start + 0.5;
  return {static_cast<float>((function[0] * x + (function[1] * (y + 0.5) + function[2])) * scale),
          static_cast<float>(function[0] * scale), start};
}

/// i, i + 1, ... (Iota with a start of its own goes through memory, and waits for it.)
template <class D>
HWY_INLINE auto counting_from(D d, int i) {
  namespace hn = hwy::HWY_NAMESPACE;
  return hn::Add(hn::Iota(d, 0), hn::Set(d, static_cast<hn::TFromD<D>>(i)));
}

/// `steps`: counting_from(d, i - r.start) for the vector at pixel i of the chunk.
template <class D, class V>
HWY_INLINE V values(D d, Ramp r, V steps) {
  namespace hn = hwy::HWY_NAMESPACE;
  return hn::MulAdd(steps, hn::Set(d, r.step), hn::Set(d, r.base));
}

/// Taps of a vector of pixels around the position (left, top), in pixel centres, >= 0. Those of
/// pixels beyond n read the frame's first pixel, to no end.
template <class D, class V>
HWY_INLINE void store_taps(D d, int frame_width, V left, V top, V weight, int i, int n,
                           Taps& taps) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::RebindToSigned<D> di;
  // Numbers added to this one are rounded to whole numbers, which stand in the last bits. A
  // position on a pixel's centre may so be its left neighbour's right end: which is the same.
  const auto rounder = hn::Set(d, 12582912.0F), half = hn::Set(d, 0.5F);  // 1.5 * 2^23
  const auto x_rounded = hn::Add(hn::Sub(left, half), rounder);
  const auto y_rounded = hn::Add(hn::Sub(top, half), rounder);
  const auto right_part = hn::Sub(left, hn::Sub(x_rounded, rounder));
  const auto lower_part = hn::Sub(top, hn::Sub(y_rounded, rounder));
  const auto lower = hn::Mul(weight, lower_part), upper = hn::Sub(weight, lower);
  auto upper_right = hn::Mul(upper, right_part), lower_right = hn::Mul(lower, right_part);
  auto upper_left = hn::Sub(upper, upper_right), lower_left = hn::Sub(lower, lower_right);
  transpose_blocks(d, upper_left, upper_right, lower_left, lower_right);
  const int lanes = static_cast<int>(hn::Lanes(d));
  float* to = taps.weight + 4 * i;
  hn::Store(upper_left, d, to);
  hn::Store(upper_right, d, to + lanes);
  hn::Store(lower_left, d, to + 2 * lanes);
  hn::Store(lower_right, d, to + 3 * lanes);
  const auto zero_bits = hn::BitCast(di, rounder);
  const auto pixel =
      hn::Add(hn::Mul(hn::Sub(hn::BitCast(di, y_rounded), zero_bits), hn::Set(di, frame_width)),
              hn::Sub(hn::BitCast(di, x_rounded), zero_bits));
  const auto counts = hn::Lt(counting_from(di, i), hn::Set(di, n));
  hn::Store(hn::IfThenElseZero(counts, pixel), di, taps.pixel + i);
}

/// Whether a camera without distortion sees the whole run of n pixels well within its frame. On its
/// way along a row a projection never turns back, so both ends tell.
inline bool sees_whole_run(const SourceView& source, int begin, int y, int n) {
  if (source.distorted) return false;
  const double* m = source.ideal_from_pixel.data();
  const double fx = source.fx, fy = source.fy;
  for (const double x : {begin + 0.5, begin + n - 0.5}) {
    const double w = m[6] * x + (m[7] * (y + 0.5) + m[8]);
    const double u = (m[0] * x + (m[1] * (y + 0.5) + m[2])) * fx + source.cx * w;  // times w
    const double v = (m[3] * x + (m[4] * (y + 0.5) + m[5])) * fy + source.cy * w;
    if (!(w > 0 && u >= w && u <= (source.width - 1) * w && v >= w && v <= (source.height - 1) * w))
      return false;
  }
  return true;
}

/// `share`: the camera's weight for each pixel of the chunk; vectors may reach beyond n.
HWY_INLINE void find_taps(const SourceView& source, int begin, int y, int n, const float* share,
                          Taps& taps) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const double* m = source.ideal_from_pixel.data();
  const int anchor = anchor_of(m, begin, y, n);  // X = 0: where the camera looks
  // Common scale of (X, Y, W): only their ratio matters, and float must hold them.
  const double w_here = m[6] * (begin + anchor + 0.5) + (m[7] * (y + 0.5) + m[8]);
  const double scale = w_here != 0 ? 1 / std::abs(w_here) : 1;
  const Ramp ramp_x = ramp(m, begin, anchor, y, scale);
  const Ramp ramp_y = ramp(m + 3, begin, anchor, y, scale);
  const Ramp ramp_w = ramp(m + 6, begin, anchor, y, scale);
  const auto set = [&](float value) HWY_ATTR { return hn::Set(d, value); };
  const auto one = set(1), zero = hn::Zero(d);

  if (sees_whole_run(source, begin, y, n)) {
    const auto fx = set(source.fx), fy = set(source.fy);
    const auto left_of = set(source.cx - 0.5F), top_of = set(source.cy - 0.5F);
    for (int i = 0; i < n; i += lanes) {
      const auto steps = counting_from(d, i - anchor);
      const auto inverse = reciprocal(d, values(d, ramp_w, steps));
      const auto left = hn::MulAdd(hn::Mul(values(d, ramp_x, steps), inverse), fx, left_of);
      const auto top = hn::MulAdd(hn::Mul(values(d, ramp_y, steps), inverse), fy, top_of);
      store_taps(d, source.width, left, top, hn::Load(d, share + i), i, n, taps);
    }
    return;
  }
  const auto half = set(0.5F);
  const auto last_x = set(static_cast<float>(source.width - 1));
  const auto last_y = set(static_cast<float>(source.height - 1));
  for (int i = 0; i < n; i += lanes) {
    const auto steps = counting_from(d, i - anchor);
    const auto w = values(d, ramp_w, steps);
    const auto in_front = hn::Gt(w, zero);
    const auto inverse = reciprocal(d, hn::IfThenElse(in_front, w, one));
    const auto x_ideal = hn::Mul(values(d, ramp_x, steps), inverse);
    const auto y_ideal = hn::Mul(values(d, ramp_y, steps), inverse);
    const auto sight = through_lens(d, source, x_ideal, y_ideal, in_front);
    const auto left = hn::Min(hn::Max(hn::Sub(sight.u, half), zero), last_x);
    const auto top = hn::Min(hn::Max(hn::Sub(sight.v, half), zero), last_y);
    store_taps(d, source.width, left, top, hn::Mul(sight.seen, hn::Load(d, share + i)), i, n, taps);
  }
}

/// Asks for the memory that a chunk's taps lie in: rows of many cameras take turns, which the
/// processor does not foresee.
HWY_INLINE void prefetch_taps(const SourceView& source, const Taps& taps, int n) {
  constexpr int kPixelsPerLine = 8;
  const std::size_t row = std::size_t{4} * static_cast<std::size_t>(source.width);
  for (int i = 0; i < n; i += kPixelsPerLine) {
    const std::uint16_t* upper =
        source.rgbx + std::size_t{4} * static_cast<std::uint32_t>(taps.pixel[i]);
    hwy::Prefetch(upper + row);  // the upper one was the lower one of the row before
  }
}

/// What a sum of samples is held in until fold(): R, G, B, weight of one pixel, or where vectors
/// are longer the left neighbours' and the right ones' side by side.
using SumTag = hwy::HWY_NAMESPACE::CappedTag<float, 8>;

/// One of a tap's rows: two neighbours of four channels, each times its own of the tap's weights,
/// the first of which is weight kFirst.
template <int kFirst, class V>
HWY_INLINE V add_neighbours(const std::uint16_t* left, const float* tap_weight, V sum) {
  namespace hn = hwy::HWY_NAMESPACE;
  const SumTag d;
  const hn::Rebind<std::uint16_t, SumTag> d16;
  const hn::Rebind<std::int32_t, SumTag> d32;
  const auto pixels = [&](const std::uint16_t* at) HWY_ATTR {
    return hn::ConvertTo(d, hn::PromoteTo(d32, hn::LoadU(d16, at)));
  };
  const auto weights = hn::LoadDup128(d, tap_weight);
  if constexpr (hn::MaxLanes(d) == 8) {
    constexpr std::uint8_t l = 4 * kFirst, r = l + 4;
    alignas(32) static constexpr std::uint8_t kSpread[32] = {
        l,     l + 1, l + 2, l + 3, l,     l + 1, l + 2, l + 3, l,     l + 1, l + 2,
        l + 3, l,     l + 1, l + 2, l + 3, r,     r + 1, r + 2, r + 3, r,     r + 1,
        r + 2, r + 3, r,     r + 1, r + 2, r + 3, r,     r + 1, r + 2, r + 3};
    const hn::Repartition<std::uint8_t, SumTag> bytes;
    const auto spread = hn::TableLookupBytes(hn::BitCast(bytes, weights), hn::Load(bytes, kSpread));
    return hn::MulAdd(hn::BitCast(d, spread), pixels(left), sum);
  } else {
    sum = hn::MulAdd(hn::Broadcast<kFirst>(weights), pixels(left), sum);
    return hn::MulAdd(hn::Broadcast<kFirst + 1>(weights), pixels(left + 4), sum);
  }
}

/// Adds the weighted neighbours of a tap: its pixel, and its four weights. `row`: of the frame, in
/// 16-bit words.
template <class V>
HWY_INLINE V add_tap(const std::uint16_t* frame, std::size_t row, std::int32_t pixel,
                     const float* weight, V sum) {
  const std::uint16_t* upper = frame + std::size_t{4} * static_cast<std::uint32_t>(pixel);
  sum = add_neighbours<0>(upper, weight, sum);
  return add_neighbours<2>(upper + row, weight, sum);
}

/// R, G, B, weight.
template <class V>
HWY_INLINE auto fold(V sum) {
  namespace hn = hwy::HWY_NAMESPACE;
  const SumTag d;
  if constexpr (hn::MaxLanes(d) == 8) {
    return hn::Add(hn::LowerHalf(sum), hn::UpperHalf(hn::Half<SumTag>(), sum));
  } else {
    return sum;
  }
}

// NOLINTNEXTLINE(google-readability-namespace-comments)
}  // namespace HWY_NAMESPACE
}  // namespace raystage
HWY_AFTER_NAMESPACE();

#endif  // per target
