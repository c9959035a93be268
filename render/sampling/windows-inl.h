// SPDX-License-Identifier: Apache-2.0
// Samples pixels that are close together in a frame bilinearly, from windows loaded into registers
// (AVX-512 only). Included once per instruction set, hence Highway's include guard. Cost: O(pixels)
// per camera, about half of that of taps-inl.h. Must match ReferenceFrames::sample().

#if defined(RAYSTAGE_RENDER_SAMPLING_WINDOWS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYSTAGE_RENDER_SAMPLING_WINDOWS_INL_H
#undef RAYSTAGE_RENDER_SAMPLING_WINDOWS_INL_H
#else
#define RAYSTAGE_RENDER_SAMPLING_WINDOWS_INL_H
#endif

// The order of these includes matters.
// clang-format off
#include <hwy/cache_control.h>
#include <hwy/highway.h>
#include "render/sampling/roots-inl.h"
#include "render/sampling/taps-inl.h"
// clang-format on

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "render/sampling/source_view.h"

#if HWY_TARGET <= HWY_AVX3  // better targets have lower numbers; others lack the instruction

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {

/// Pixels of a row in two vectors: a window. It is used if all left neighbours of a vector of taps
/// are among its first kWindow - 1 pixels. The window is then read once per row, and a permutation
/// selects the taps.
constexpr int kWindow = 16;
/// With this many windows per vector the cost is about half of that of single taps.
constexpr int kMaxWindows = 2;

/// A camera for a run of pixels that are all well within its frame.
struct WindowedCamera {
  const std::uint16_t* rgba;
  std::size_t row;           ///< values from one row to the next
  Ramp x, y, w;              ///< ideal_from_pixel times (fx, fy, 1), from the first pixel on
  float left, top;           ///< principal point - 1/2, in units of pixel centres
  std::int32_t width, back;  ///< `back`: pixels from a window's begin to its first tap
};

/// Returns whether windows are efficient for n pixels; sets `camera` if so. The camera must see all
/// pixels, roughly along its rows, and at a scale at which a vector needs few windows.
inline bool fits_windows(const SourceView& source, int begin, int y, int n,
                         WindowedCamera& camera) {
  // A window at the frame's end extends at most into the next row.
  if (source.width < kWindow || !run_is_inside_frame(source, begin, y, n)) return false;
  const double* m = source.ideal_from_pixel.data();
  const double first = begin + 0.5, last = begin + n - 0.5;
  const auto at = [&](int axis, double x) {
    return m[3 * axis] * x + (m[3 * axis + 1] * (y + 0.5) + m[3 * axis + 2]);
  };
  const double scale = 1 / at(2, first), last_scale = 1 / at(2, last);
  const double along = source.fx * (at(0, last) * last_scale - at(0, first) * scale);
  const double across = source.fy * (at(1, last) * last_scale - at(1, first) * scale);
  const double windows = std::abs(along) / (kWindow - 2) + std::abs(across);
  if (windows > kMaxWindows * n / 16.0) return false;
  camera.rgba = source.rgba;
  camera.row = std::size_t{4} * static_cast<std::size_t>(source.width);
  camera.x = ramp(m, begin, 0, y, scale * source.fx);
  camera.y = ramp(m + 3, begin, 0, y, scale * source.fy);
  camera.w = ramp(m + 6, begin, 0, y, scale);
  camera.left = source.cx - 1;
  camera.top = source.cy - 1;
  camera.width = source.width;
  camera.back = along < 0 ? kWindow - 2 : 0;
  return true;
}

/// For each pixel of a chunk: the index in the frame of the upper left of four neighbours, and its
/// weights. The weights of left and right (times kWeightUnit) are in the halves of each word; the
/// weights of the upper and lower row are separate.
struct WindowTaps {
  HWY_ALIGN std::int32_t pixel[kChunk], pairs[kChunk];
  HWY_ALIGN float upper[kChunk], lower[kChunk];
};

/// Computes taps of n pixels of a chunk that begins `from` pixels after the run. share(i): the
/// camera's weight for a vector of rays, divided by kWeightUnit.
template <class Share>
HWY_INLINE void compute_window_taps(const WindowedCamera& camera, int from, int n,
                                    const Share& share, WindowTaps& taps) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> d32;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto set = [&](float value) HWY_ATTR { return hn::Set(d, value); };
  // As store_taps().
  constexpr float kRounder = 12582912.0F;
  constexpr std::int32_t kRounderBits = 0x4B400000;
  const auto rounder = set(kRounder), unit = set(kWeightUnit),
             half_unit = set(kRounder + kWeightUnit / 2);
  const auto whole = hn::Set(d32, kRounderBits + static_cast<std::int32_t>(kWeightUnit));
  const auto rounders =
      hn::Set(d32, static_cast<std::int32_t>(static_cast<std::uint32_t>(kRounderBits) *
                                             (static_cast<std::uint32_t>(camera.width) + 1)));
  const auto width = hn::Set(d32, camera.width);
  const auto principal_left = set(camera.left), principal_top = set(camera.top);
  const auto stride = set(static_cast<float>(lanes)), half = set(0.5F);
  auto steps = iota_from(d, from);
  for (int i = 0; i < n; i += lanes, steps = hn::Add(steps, stride)) {
    const auto inverse = reciprocal(d, values(d, camera.w, steps));
    const auto left = hn::MulAdd(values(d, camera.x, steps), inverse, principal_left);
    const auto top = hn::MulAdd(values(d, camera.y, steps), inverse, principal_top);
    const auto column = hn::Add(left, rounder), line = hn::Add(top, rounder);
    const auto to_right = hn::Sub(left, hn::Sub(column, rounder));  // minus 1/2
    const auto to_lower = hn::Sub(top, hn::Sub(line, rounder));
    const auto right = hn::BitCast(d32, hn::MulAdd(to_right, unit, half_unit));
    const auto pixel = hn::Sub(
        hn::Add(hn::Mul(hn::BitCast(d32, line), width), hn::BitCast(d32, column)), rounders);
    const auto all = share(i);
    const auto lower = hn::Mul(all, hn::Add(to_lower, half));
    hn::Store(pixel, d32, taps.pixel + i);
    hn::Store(hn::Add(hn::Sub(hn::ShiftLeft<16>(right), right), whole), d32, taps.pairs + i);
    hn::Store(lower, d, taps.lower + i);
    hn::Store(hn::Sub(all, lower), d, taps.upper + i);
  }
}

/// Sums of a chunk's pixels: (codes - 32768) times kWeightUnit and weight; and weights.
struct WindowSums {
  HWY_ALIGN float r[kChunk], g[kChunk], b[kChunk], share[kChunk];
};

/// Adds one window's samples. `column`: column in the window of each tap's left neighbour.
template <class D, class V, class VI>
HWY_INLINE void add_window(D d, const std::uint16_t* upper_row, std::size_t row, VI column,
                           VI pairs, V upper, V lower, V& r, V& g, V& b) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::RebindToSigned<D> d32;
  const hn::Repartition<std::int16_t, D> d16;
  const hn::Repartition<std::uint16_t, D> du16;
  const auto middle = hn::Set(du16, std::uint16_t{32768});
  const auto codes = [&](const std::uint16_t* at) HWY_ATTR {
    return hn::BitCast(d16, hn::Xor(hn::LoadU(du16, at), middle));
  };
  constexpr int kHalf = kWindow / 2 * 4;
  const std::uint16_t* lower_row = upper_row + row;
  const auto upper_begin = codes(upper_row), upper_end = codes(upper_row + kHalf);
  const auto lower_begin = codes(lower_row), lower_end = codes(lower_row + kHalf);
  const auto left_red = hn::ShiftLeft<2>(column);
  const auto red = hn::Or(left_red, hn::ShiftLeft<16>(left_red));
  const auto weights = hn::BitCast(d16, pairs);
  const auto add = [&](std::int32_t channel, V& sum) HWY_ATTR {
    const auto words = hn::Add(red, hn::Set(d32, ((4 + channel) << 16) | channel));
    const auto blend = [&](auto of_begin, auto of_end) HWY_ATTR {  // Highway 1.0.3 lacks it
      const decltype(of_begin) picked{
          _mm512_permutex2var_epi16(of_begin.raw, words.raw, of_end.raw)};
      auto unused = hn::Zero(d32);
      return hn::ConvertTo(
          d, hn::ReorderWidenMulAccumulate(d32, picked, weights, hn::Zero(d32), unused));
    };
    sum = hn::MulAdd(blend(upper_begin, upper_end), upper, sum);
    sum = hn::MulAdd(blend(lower_begin, lower_end), lower, sum);
  };
  add(0, r);
  add(1, g);
  add(2, b);
}

/// Adds the samples of `count` cameras for n pixels of a chunk.
HWY_INLINE void add_window_samples(const WindowedCamera* cameras, const WindowTaps* taps, int count,
                                   int n, WindowSums& sums) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> d32;
  const hn::RebindToUnsigned<decltype(d)> du32;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto last_column = hn::Set(du32, kWindow - 2);
  for (int i = 0; i < n; i += lanes) {
    auto r = hn::Load(d, sums.r + i), g = hn::Load(d, sums.g + i), b = hn::Load(d, sums.b + i);
    for (int c = 0; c < count; ++c) {
      const auto pixel = hn::Load(d32, taps[c].pixel + i), pairs = hn::Load(d32, taps[c].pairs + i);
      auto upper = hn::Load(d, taps[c].upper + i), lower = hn::Load(d, taps[c].lower + i);
      auto needed = hn::FirstN(du32, static_cast<std::size_t>(n - i));
      std::int32_t first = taps[c].pixel[i];
      for (;;) {
        const std::int32_t begin = std::max(first - cameras[c].back, 0);
        const auto column = hn::Sub(pixel, hn::Set(d32, begin));
        const auto beyond = hn::And(hn::Gt(hn::BitCast(du32, column), last_column), needed);
        const std::uint16_t* from =
            cameras[c].rgba + std::size_t{4} * static_cast<std::size_t>(begin);
        hwy::Prefetch(from + 2 * cameras[c].row);  // for the view's next row
        hwy::Prefetch(from + 2 * cameras[c].row + kWindow * 2);
        if (HWY_LIKELY(hn::AllFalse(du32, beyond))) {
          add_window(d, from, cameras[c].row, column, pairs, upper, lower, r, g, b);
          break;
        }
        const auto outside = hn::RebindMask(d, beyond);
        add_window(d, from, cameras[c].row, column, pairs, hn::IfThenZeroElse(outside, upper),
                   hn::IfThenZeroElse(outside, lower), r, g, b);
        upper = hn::IfThenElseZero(outside, upper);
        lower = hn::IfThenElseZero(outside, lower);
        needed = beyond;
        first = taps[c].pixel[i + hn::FindFirstTrue(du32, needed)];
      }
    }
    hn::Store(r, d, sums.r + i);
    hn::Store(g, d, sums.g + i);
    hn::Store(b, d, sums.b + i);
  }
}

// NOLINTNEXTLINE(google-readability-namespace-comments)
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#endif  // AVX-512

#endif  // per target
