// SPDX-License-Identifier: Apache-2.0
// Computes where a camera's frame is sampled for a run of pixels, and its bilinear samples, with
// SIMD. Included once per instruction set, hence Highway's include guard. Cost: O(pixels) per
// camera. Must match ReferenceFrames::sample() (reference_renderer.cpp).

#if defined(RAYSTAGE_RENDER_SAMPLING_TAPS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYSTAGE_RENDER_SAMPLING_TAPS_INL_H
#undef RAYSTAGE_RENDER_SAMPLING_TAPS_INL_H
#else
#define RAYSTAGE_RENDER_SAMPLING_TAPS_INL_H
#endif

// The order of these includes matters.
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
namespace raystage::render {
namespace HWY_NAMESPACE {

/// Pixels per chunk: positions are vectors across pixels, samples are vectors across taps and
/// colours.
constexpr int kChunk = 128;

/// The exact sum of a tap's interpolation weights, which are integers, so that sums of their
/// products with codes fit in 32 bits. Positions are thereby rounded to 1/32768 of a pixel.
constexpr float kWeightUnit = 16384.0F;

/// For each pixel of a chunk: the index in the frame of the upper left of four neighbours, their
/// weights, and the camera's weight for the ray, divided by kWeightUnit. The weights of the upper
/// two and of the lower two are a word each, with the left one in the lower half.
struct Taps {
  HWY_ALIGN std::int32_t pixel[kChunk];
  HWY_ALIGN std::int32_t upper[kChunk], lower[kChunk];
  HWY_ALIGN float share[kChunk];
};

/// The weights of a tap's four neighbours.
struct TapWeights {
  int upper_left, upper_right, lower_left, lower_right;
};
HWY_INLINE TapWeights tap_weights(const Taps& taps, int i) {
  const std::uint32_t upper = static_cast<std::uint32_t>(taps.upper[i]);
  const std::uint32_t lower = static_cast<std::uint32_t>(taps.lower[i]);
  const auto half = [](std::uint32_t word) { return static_cast<std::int16_t>(word & 0xFFFF); };
  return {half(upper), half(upper >> 16), half(lower), half(lower >> 16)};
}

/// Transposes 4 x 4 values within each 128-bit block: four vectors of one channel each become four
/// vectors of whole pixels, or the reverse. Values do not cross blocks, which is fast, but pixels
/// get the order of transposed_index().
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

/// Returns where transpose_blocks() puts pixel i of a chunk.
template <class D>
HWY_INLINE int transposed_index(D d, int i) {
  const int lanes = static_cast<int>(hwy::HWY_NAMESPACE::Lanes(d));
  const int within = i % lanes;
  return i - within + within % 4 * (lanes / 4) + within / 4;
}

/// Returns the pixel, from 0 to n - 1, of a chunk at which a linear function is nearest to 0. With
/// this anchor the function's values are exact to a few units in their own last place, although
/// they may be much larger elsewhere in the chunk.
inline int ramp_anchor(const double* function, int begin, int y, int n) {
  if (function[0] == 0) return 0;
  const double at_begin = function[0] * (begin + 0.5) + (function[1] * (y + 0.5) + function[2]);
  return static_cast<int>(std::clamp(std::floor(0.5 - at_begin / function[0]), 0.0, n - 1.0));
}

/// A linear function of the pixel: `base` at pixel `start` of the chunk, computed in double, and
/// the step per pixel in float.
struct Ramp {
  float base, step;
  int start;
};
HWY_INLINE Ramp ramp(const double* function, int begin, int start, int y, double scale) {
  const double x = begin + start + 0.5;
  return {static_cast<float>((function[0] * x + (function[1] * (y + 0.5) + function[2])) * scale),
          static_cast<float>(function[0] * scale), start};
}

/// Returns i, i + 1, ... (Highway's Iota with a start other than 0 goes through memory.)
template <class D>
HWY_INLINE auto iota_from(D d, int i) {
  namespace hn = hwy::HWY_NAMESPACE;
  return hn::Add(hn::Iota(d, 0), hn::Set(d, static_cast<hn::TFromD<D>>(i)));
}

/// Returns the ramp's values. `steps`: iota_from(d, i - r.start) for pixels i on of the chunk.
template <class D, class V>
HWY_INLINE V values(D d, Ramp r, V steps) {
  namespace hn = hwy::HWY_NAMESPACE;
  return hn::MulAdd(steps, hn::Set(d, r.step), hn::Set(d, r.base));
}

/// Stores the taps of a vector of pixels. The position, (left, top) + 1/2 in units of pixel
/// centres, must be at least 0.
template <class D, class V>
HWY_INLINE void store_taps(D d, int frame_width, V left, V top, V weight, int i, Taps& taps) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::RebindToSigned<D> di;
  // Adding this constant rounds to an integer in the last bits. A position on a pixel's centre may
  // become the right end of its left neighbour, which gives the same sample.
  constexpr float kRounder = 12582912.0F;  // 1.5 * 2^23
  constexpr std::int32_t kRounderBits = 0x4B400000;
  constexpr std::int32_t kWhole = static_cast<std::int32_t>(kWeightUnit);
  const auto rounder = hn::Set(d, kRounder), unit = hn::Set(d, kWeightUnit);
  const auto half_unit = hn::Set(d, kWeightUnit / 2);
  const auto column = hn::Add(left, rounder), line = hn::Add(top, rounder);
  // Distance from the upper left neighbour in units of 1 / kWeightUnit.
  const auto right_units = hn::MulAdd(hn::Sub(left, hn::Sub(column, rounder)), unit, half_unit);
  const auto lower_units = hn::MulAdd(hn::Sub(top, hn::Sub(line, rounder)), unit, half_unit);
  const auto both_units =
      hn::MulAdd(hn::Mul(right_units, hn::Set(d, 1 / kWeightUnit)), lower_units, rounder);
  const auto right = hn::BitCast(di, hn::Add(right_units, rounder));
  const auto lower = hn::BitCast(di, hn::Add(lower_units, rounder));
  const auto both = hn::BitCast(di, both_units);
  const auto upper_right = hn::Sub(right, both), lower_left = hn::Sub(lower, both);
  const auto upper_left = hn::Sub(hn::Sub(hn::Set(di, kRounderBits + kWhole), lower), upper_right);
  const hn::Repartition<std::int16_t, D> d16;
  const auto store_pair = [&](auto of_left, auto of_right, std::int32_t* to) HWY_ATTR {
    const auto shifted = hn::BitCast(d16, hn::ShiftLeft<16>(of_right));
    hn::Store(hn::BitCast(di, hn::OddEven(shifted, hn::BitCast(d16, of_left))), di, to + i);
  };
  store_pair(upper_left, upper_right, taps.upper);
  store_pair(lower_left, both, taps.lower);  // shifts out the rounder's bits
  hn::Store(hn::Mul(weight, hn::Set(d, 1 / kWeightUnit)), d, taps.share + i);
  // Subtracts the rounder's bits, times width + 1, modulo 2^32.
  const auto rounders =
      hn::Set(di, static_cast<std::int32_t>(static_cast<std::uint32_t>(kRounderBits) *
                                            (static_cast<std::uint32_t>(frame_width) + 1)));
  const auto pixel =
      hn::Add(hn::Mul(hn::BitCast(di, line), hn::Set(di, frame_width)), hn::BitCast(di, column));
  hn::Store(hn::Sub(pixel, rounders), di, taps.pixel + i);
}

/// Returns whether a camera without distortion sees the whole run of n pixels well within its
/// frame. Both ends decide, because a projection is monotone along a row.
inline bool run_is_inside_frame(const SourceView& source, int begin, int y, int n) {
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

/// Sets taps beyond n, up to a whole vector, to the frame's first pixel; their values are unused.
HWY_INLINE void pad_taps(int n, Taps& taps) {
  namespace hn = hwy::HWY_NAMESPACE;
  const int lanes = static_cast<int>(hn::Lanes(hn::ScalableTag<float>()));
  for (int i = n; i % lanes != 0; ++i) taps.pixel[i] = 0;
}

/// Returns the frame positions of the directions (x right, y down, w ahead).
template <class D, class V>
HWY_INLINE FramePosition<V> frame_position(D d, const SourceView& source, V x, V y, V w) {
  namespace hn = hwy::HWY_NAMESPACE;
  if (source.is_fisheye) return project_through_fisheye(d, source, x, y, w);
  const auto in_front = hn::Gt(w, hn::Zero(d));
  const auto scale = reciprocal(d, hn::IfThenElse(in_front, w, hn::Set(d, 1.0F)));
  return project_through_lens(d, source, hn::Mul(x, scale), hn::Mul(y, scale), in_front);
}

/// Computes taps on a plane. `share`: camera weight per pixel, read in whole vectors beyond n.
HWY_INLINE void compute_taps(const SourceView& source, int begin, int y, int n, const float* share,
                             Taps& taps) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const double* m = source.ideal_from_pixel.data();
  const int anchor = ramp_anchor(m, begin, y, n);  // X = 0: the camera's axis
  // Common scale of (X, Y, W): only their ratio matters, and float must hold them.
  const double at_x = begin + anchor + 0.5, at_y = y + 0.5;
  const auto here = [&](int row) {
    return std::abs(m[3 * row] * at_x + (m[3 * row + 1] * at_y + m[3 * row + 2]));
  };
  // A fisheye sees where W is 0.
  const double size = source.is_fisheye ? std::max({here(0), here(1), here(2)}) : here(2);
  const double scale = size != 0 ? 1 / size : 1;
  const Ramp ramp_x = ramp(m, begin, anchor, y, scale);
  const Ramp ramp_y = ramp(m + 3, begin, anchor, y, scale);
  const Ramp ramp_w = ramp(m + 6, begin, anchor, y, scale);
  const auto set = [&](float value) HWY_ATTR { return hn::Set(d, value); };
  const auto zero = hn::Zero(d), stride = set(static_cast<float>(lanes));

  if (run_is_inside_frame(source, begin, y, n)) {
    const auto fx = set(source.fx), fy = set(source.fy);
    const auto left_of = set(source.cx - 1), top_of = set(source.cy - 1);
    auto steps = iota_from(d, -anchor);
    for (int i = 0; i < n; i += lanes, steps = hn::Add(steps, stride)) {
      const auto inverse = reciprocal(d, values(d, ramp_w, steps));
      const auto left = hn::MulAdd(hn::Mul(values(d, ramp_x, steps), inverse), fx, left_of);
      const auto top = hn::MulAdd(hn::Mul(values(d, ramp_y, steps), inverse), fy, top_of);
      store_taps(d, source.width, left, top, hn::Load(d, share + i), i, taps);
    }
    pad_taps(n, taps);
    return;
  }
  const auto half = set(0.5F);
  const auto last_x = set(static_cast<float>(source.width - 1));
  const auto last_y = set(static_cast<float>(source.height - 1));
  auto steps = iota_from(d, -anchor);
  for (int i = 0; i < n; i += lanes, steps = hn::Add(steps, stride)) {
    const auto sight = frame_position(d, source, values(d, ramp_x, steps), values(d, ramp_y, steps),
                                      values(d, ramp_w, steps));
    const auto left = hn::Min(hn::Max(hn::Sub(sight.u, half), zero), last_x);
    const auto top = hn::Min(hn::Max(hn::Sub(sight.v, half), zero), last_y);
    store_taps(d, source.width, hn::Sub(left, half), hn::Sub(top, half),
               hn::Mul(sight.seen, hn::Load(d, share + i)), i, taps);
  }
  pad_taps(n, taps);
}

/// Computes taps of pixels with individual depths: `source` as for a plane at infinity, plus
/// `inverse_depth` (1/m) times `per_inverse_depth` (see DepthSource).
HWY_INLINE void compute_taps_at_depth(const SourceView& source, const double* per_inverse_depth,
                                      int begin, int y, int n, const float* inverse_depth,
                                      const float* share, Taps& taps) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const double* m = source.ideal_from_pixel.data();
  const int anchor = ramp_anchor(m, begin, y, n);
  const auto zero = hn::Zero(d), half = hn::Set(d, 0.5F);
  const auto last_x = hn::Set(d, static_cast<float>(source.width - 1));
  const auto last_y = hn::Set(d, static_cast<float>(source.height - 1));
  for (int i = 0; i < n; i += lanes) {
    const auto steps = iota_from(d, i - anchor);
    const auto inverse = hn::LoadU(d, inverse_depth + i);
    const auto along = [&](int axis) HWY_ATTR {
      const auto way = hn::Set(d, static_cast<float>(per_inverse_depth[axis]));
      return hn::MulAdd(inverse, way, values(d, ramp(m + 3 * axis, begin, anchor, y, 1), steps));
    };
    const auto sight = frame_position(d, source, along(0), along(1), along(2));
    const auto left = hn::Min(hn::Max(hn::Sub(sight.u, half), zero), last_x);
    const auto top = hn::Min(hn::Max(hn::Sub(sight.v, half), zero), last_y);
    store_taps(d, source.width, hn::Sub(left, half), hn::Sub(top, half),
               hn::Mul(sight.seen, hn::Load(d, share + i)), i, taps);
  }
  pad_taps(n, taps);
}

/// Prefetches the memory of a chunk's taps, because the processor cannot predict alternating rows
/// of many cameras.
HWY_INLINE void prefetch_taps(const SourceView& source, const Taps& taps, int n) {
  constexpr int kPixelsPerLine = 8;
  const std::size_t row = std::size_t{4} * static_cast<std::size_t>(source.width);
  for (int i = 0; i < n; i += kPixelsPerLine) {
    const std::uint16_t* upper =
        source.rgba + std::size_t{4} * static_cast<std::uint32_t>(taps.pixel[i]);
    hwy::Prefetch(upper + 2 * row);  // for the view's next row
  }
}

/// Loads the left and right neighbours of taps 4 pixels apart: one tap per 128 bits, 4 channels per
/// pixel. `row`: a row of the frame.
template <class D16>
HWY_INLINE hwy::HWY_NAMESPACE::Vec<D16> load_neighbours(D16 d, const std::uint16_t* row,
                                                        const std::int32_t* pixel) {
  namespace hn = hwy::HWY_NAMESPACE;
  if constexpr (hn::MaxLanes(d) == 8) {
    return hn::LoadU(d, row + std::size_t{4} * static_cast<std::uint32_t>(*pixel));
  } else {
    const hn::Half<D16> half;
    const std::int32_t* upper_half = pixel + hn::MaxLanes(d) / 4;
    return hn::Combine(d, load_neighbours(half, row, upper_half),
                       load_neighbours(half, row, pixel));
  }
}

/// Adds the samples of every fourth of a vector's taps, from kFirst on, to `sum`: R, G, B, weight
/// in every 128 bits. `upper`, `lower`, `share`: of all taps of the vector.
template <int kFirst, class D, class V, class VI>
HWY_INLINE V add_taps(D d, const std::uint16_t* frame, std::size_t row, const std::int32_t* pixel,
                      VI upper, VI lower, V share, V sum) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::RebindToSigned<D> d32;
  const hn::Repartition<std::int16_t, D> d16;
  const hn::Repartition<std::uint16_t, D> du16;
  const hn::Repartition<std::uint8_t, D> bytes;
  alignas(16) static constexpr std::uint8_t kPairs[16] = {0, 1, 8,  9,  2, 3, 10, 11,
                                                          4, 5, 12, 13, 6, 7, 14, 15};
  const auto pairs = hn::LoadDup128(bytes, kPairs);
  const auto middle = hn::Set(du16, std::uint16_t{32768});
  const auto codes = [&](const std::uint16_t* of_row) HWY_ATTR {
    const auto neighbours = hn::Xor(load_neighbours(du16, of_row, pixel + kFirst), middle);
    return hn::BitCast(d16, hn::TableLookupBytes(hn::BitCast(bytes, neighbours), pairs));
  };
  const auto of_tap = [&](VI weights)
                          HWY_ATTR { return hn::BitCast(d16, hn::Broadcast<kFirst>(weights)); };
  auto unused = hn::Zero(d32);
  auto total = hn::Set(d32, 32768 * static_cast<std::int32_t>(kWeightUnit));
  total = hn::ReorderWidenMulAccumulate(d32, codes(frame), of_tap(upper), total, unused);
  total = hn::ReorderWidenMulAccumulate(d32, codes(frame + row), of_tap(lower), total, unused);
  return hn::MulAdd(hn::ConvertTo(d, total), hn::Broadcast<kFirst>(share), sum);
}

// NOLINTNEXTLINE(google-readability-namespace-comments)
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#endif  // per target
