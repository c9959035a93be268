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
#include <hwy/highway.h>
#include "render/sampling/lens-inl.h"
// clang-format on

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
/// share of the ray).
struct Taps {
  HWY_ALIGN std::int32_t pixel[kChunk];
  HWY_ALIGN float weight[4 * kChunk];
};

/// A linear function of the pixel, from the chunk's first pixel on: the base in double, the short
/// way from there in float.
struct Ramp {
  float base, step;
};
HWY_INLINE Ramp ramp(const double* function, int x, int y, double scale) {
  return {static_cast<float>((function[0] * (x + 0.5) + (function[1] * (y + 0.5) + function[2])) *
                             scale),
          static_cast<float>(function[0] * scale)};
}

template <class D, class V>
HWY_INLINE V values(D d, Ramp r, V steps) {
  namespace hn = hwy::HWY_NAMESPACE;
  return hn::MulAdd(steps, hn::Set(d, r.step), hn::Set(d, r.base));
}

/// Taps of a vector of pixels around the position (left, top), in pixel centres, >= 0.
template <class D, class V>
HWY_INLINE void store_taps(D d, int frame_width, V left, V top, V weight, int i, Taps& taps) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::RebindToSigned<D> di;
  const auto x = hn::Floor(left), y = hn::Floor(top);
  const auto right_part = hn::Sub(left, x), lower_part = hn::Sub(top, y);
  const auto lower = hn::Mul(weight, lower_part), upper = hn::Sub(weight, lower);
  const auto upper_right = hn::Mul(upper, right_part), lower_right = hn::Mul(lower, right_part);
  hn::Store(hn::Add(hn::Mul(hn::ConvertTo(di, y), hn::Set(di, frame_width)), hn::ConvertTo(di, x)),
            di, taps.pixel + i);
  hn::StoreInterleaved4(hn::Sub(upper, upper_right), upper_right, hn::Sub(lower, lower_right),
                        lower_right, d, taps.weight + 4 * i);
}

/// Whether a camera without distortion sees the whole run of n pixels well within its frame. On its
/// way along a row a projection never turns back, so both ends tell.
inline bool sees_whole_run(const SourceView& source, int begin, int y, int n) {
  if (source.distorted) return false;
  const double* m = source.ideal_from_pixel.data();
  for (const double x : {begin + 0.5, begin + n - 0.5}) {
    const double w = m[6] * x + (m[7] * (y + 0.5) + m[8]);
    if (!(w > 0)) return false;
    const double u = (m[0] * x + (m[1] * (y + 0.5) + m[2])) / w * source.fx + source.cx;
    const double v = (m[3] * x + (m[4] * (y + 0.5) + m[5])) / w * source.fy + source.cy;
    if (!(u >= 1 && u <= source.width - 1 && v >= 1 && v <= source.height - 1)) return false;
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
  // Common scale of (X, Y, W): only their ratio matters, and float must hold them.
  const double w_here = m[6] * (begin + 0.5) + (m[7] * (y + 0.5) + m[8]);
  const double scale = w_here != 0 ? 1 / std::abs(w_here) : 1;
  const Ramp ramp_x = ramp(m, begin, y, scale);
  const Ramp ramp_y = ramp(m + 3, begin, y, scale);
  const Ramp ramp_w = ramp(m + 6, begin, y, scale);
  const auto set = [&](float value) HWY_ATTR { return hn::Set(d, value); };
  const auto one = set(1), zero = hn::Zero(d);

  if (sees_whole_run(source, begin, y, n)) {
    const auto fx = set(source.fx), fy = set(source.fy);
    const auto left_of = set(source.cx - 0.5F), top_of = set(source.cy - 0.5F);
    for (int i = 0; i < n; i += lanes) {
      const auto steps = hn::Iota(d, static_cast<float>(i));
      const auto inverse = hn::Div(one, values(d, ramp_w, steps));
      const auto left = hn::MulAdd(hn::Mul(values(d, ramp_x, steps), inverse), fx, left_of);
      const auto top = hn::MulAdd(hn::Mul(values(d, ramp_y, steps), inverse), fy, top_of);
      store_taps(d, source.width, left, top, hn::Load(d, share + i), i, taps);
    }
    return;
  }
  const auto half = set(0.5F);
  const auto last_x = set(static_cast<float>(source.width - 1));
  const auto last_y = set(static_cast<float>(source.height - 1));
  for (int i = 0; i < n; i += lanes) {
    const auto steps = hn::Iota(d, static_cast<float>(i));
    const auto w = values(d, ramp_w, steps);
    const auto in_front = hn::Gt(w, zero);
    const auto inverse = hn::Div(one, hn::IfThenElse(in_front, w, one));
    const auto x_ideal = hn::Mul(values(d, ramp_x, steps), inverse);
    const auto y_ideal = hn::Mul(values(d, ramp_y, steps), inverse);
    const auto sight = through_lens(d, source, x_ideal, y_ideal, in_front);
    const auto left = hn::Min(hn::Max(hn::Sub(sight.u, half), zero), last_x);
    const auto top = hn::Min(hn::Max(hn::Sub(sight.v, half), zero), last_y);
    store_taps(d, source.width, left, top, hn::Mul(sight.seen, hn::Load(d, share + i)), i, taps);
  }
}

/// What a sum of samples is held in: one pixel's colours, or where vectors are longer those of a
/// pixel and of its right neighbour, side by side until fold().
using SumTag = hwy::HWY_NAMESPACE::CappedTag<float, 8>;

/// One of a tap's rows: two neighbours, four channels each, times a weight of its own each.
/// `kFirst`: which of the tap's weights is the left neighbour's.
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

/// Adds the weighted neighbours of a chunk's pixel i. `row`: of the frame, in 16-bit words.
template <class V>
HWY_INLINE V add_tap(const std::uint16_t* frame, std::size_t row, const Taps& taps, int i, V sum) {
  const std::uint16_t* upper = frame + std::size_t{4} * static_cast<std::uint32_t>(taps.pixel[i]);
  const float* weight = taps.weight + 4 * i;
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
