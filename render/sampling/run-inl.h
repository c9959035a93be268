// SPDX-License-Identifier: Apache-2.0
// Computes camera weights of a run of pixels, accumulates samples and writes pixels, with SIMD.
// Included once per instruction set, hence Highway's include guard. Cost: O(pixels x cameras).
// Weights must match RayCells::crossing_in_cell(), depths PlaneProjection::depth().

#if defined(RAYSTAGE_RENDER_SAMPLING_RUN_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYSTAGE_RENDER_SAMPLING_RUN_INL_H
#undef RAYSTAGE_RENDER_SAMPLING_RUN_INL_H
#else
#define RAYSTAGE_RENDER_SAMPLING_RUN_INL_H
#endif

// The order of these includes matters.
// clang-format off
#include <hwy/highway.h>
#include "render/sampling/finish-inl.h"
#include "render/sampling/taps-inl.h"
// clang-format on

#include <algorithm>
#include <array>
#include <atomic>
#include <limits>

#include "render/sampling/source_view.h"

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {

struct Weights {
  HWY_ALIGN float camera[3][kChunk];
};

HWY_INLINE void compute_weights(const PixelRun& run, int begin, int n, Weights& weights) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const double middle = begin + 0.5 * n;
  const double total = run.total[0] * middle + (run.total[1] * (run.y + 0.5) + run.total[2]);
  const double scale = 1 / total;  // keeps weights near 1 at any distance to the array
  Ramp shares[3] = {};
  const int anchor = ramp_anchor(run.total.data(), begin, run.y, n);
  for (int c = 0; c < run.count; ++c) {
    shares[c] = ramp(run.share[c].data(), begin, anchor, run.y, scale);
  }
  for (int i = 0; i < n; i += lanes) {
    const auto steps = iota_from(d, i - anchor);
    const auto zero = hn::Zero(d);
    const auto w0 = hn::Max(values(d, shares[0], steps), zero);
    const auto w1 = hn::Max(values(d, shares[1], steps), zero);
    const auto w2 = hn::Max(values(d, shares[2], steps), zero);
    const auto sum = hn::Add(w0, hn::Add(w1, w2));
    const auto inverse = hn::IfThenElseZero(hn::Gt(sum, hn::Set(d, 1e-30F)), reciprocal(d, sum));
    hn::Store(hn::Mul(w0, inverse), d, weights.camera[0] + i);
    hn::Store(hn::Mul(w1, inverse), d, weights.camera[1] + i);
    hn::Store(hn::Mul(w2, inverse), d, weights.camera[2] + i);
  }
}

/// Returns 1 / planar depth of the plane with this slope and distance (PixelRun), where positive.
HWY_INLINE Ramp inverse_depth(const std::array<double, 3>& slope, double distance, int begin, int y,
                              int n) {
  return ramp(slope.data(), begin, ramp_anchor(slope.data(), begin, y, n), y, 1 / distance);
}

/// Sets the weights of rays that do not meet the focal plane to 0. `along`: 1 / planar depth.
HWY_INLINE void clear_missed_rays(Ramp along, int n, Weights& weights) {
  namespace hn = hwy::HWY_NAMESPACE;
  const auto at = [&](int i) {
    return along.base + static_cast<float>(i - along.start) * along.step;
  };
  if (at(0) > 0 && at(n - 1) > 0) return;
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int i = 0; i < n; i += lanes) {
    const auto met = hn::Gt(values(d, along, iota_from(d, i - along.start)), hn::Zero(d));
    for (auto& camera : weights.camera) {
      hn::Store(hn::IfThenElseZero(met, hn::Load(d, camera + i)), d, camera + i);
    }
  }
}

/// Adds the samples of `count` cameras to `sums`, in whole vectors of pixels: 4 floats per pixel,
/// in the order of transpose_blocks(). kFirst: overwrites `sums`.
template <bool kFirst>
HWY_INLINE void add_samples(const SourceView* const* sources, const Taps* taps, int count, int n,
                            float* sums) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> di;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int i = 0; i < n; i += lanes) {
    float* to = sums + 4 * i;
    auto sum0 = hn::Zero(d), sum1 = sum0, sum2 = sum0, sum3 = sum0;
    if constexpr (!kFirst) {
      sum0 = hn::Load(d, to);
      sum1 = hn::Load(d, to + lanes);
      sum2 = hn::Load(d, to + 2 * lanes);
      sum3 = hn::Load(d, to + 3 * lanes);
    }
    for (int c = 0; c < count; ++c) {
      const std::uint16_t* frame = sources[c]->rgba;
      const std::size_t row = std::size_t{4} * static_cast<std::size_t>(sources[c]->width);
      const std::int32_t* pixel = taps[c].pixel + i;
      const auto upper = hn::Load(di, taps[c].upper + i), lower = hn::Load(di, taps[c].lower + i);
      const auto share = hn::Load(d, taps[c].share + i);
      sum0 = add_taps<0>(d, frame, row, pixel, upper, lower, share, sum0);
      sum1 = add_taps<1>(d, frame, row, pixel, upper, lower, share, sum1);
      sum2 = add_taps<2>(d, frame, row, pixel, upper, lower, share, sum2);
      sum3 = add_taps<3>(d, frame, row, pixel, upper, lower, share, sum3);
    }
    hn::Store(sum0, d, to);
    hn::Store(sum1, d, to + lanes);
    hn::Store(sum2, d, to + 2 * lanes);
    hn::Store(sum3, d, to + 3 * lanes);
  }
}

/// A vector of the view's pixels.
struct Pixels {
  HWY_ALIGN float rgba[4 * hwy::HWY_NAMESPACE::MaxLanes(hwy::HWY_NAMESPACE::ScalableTag<float>())];
  HWY_ALIGN float coverage[hwy::HWY_NAMESPACE::MaxLanes(hwy::HWY_NAMESPACE::ScalableTag<float>())];
  HWY_ALIGN float z[hwy::HWY_NAMESPACE::MaxLanes(hwy::HWY_NAMESPACE::ScalableTag<float>())];
};

/// Writes pixels of the view, up to `room` of them, from sums in the order of transpose_blocks().
/// `along`: 1 / planar depth. `share`: factor of each pixel's sums, or null. `present`: factor from
/// alpha to coverage, or null.
HWY_INLINE void write_pixels(const float* sums, const float* share, const float* present, int n,
                             int room, store::BlendSpace space, float full_scale, Ramp along,
                             bool at_infinity, float* rgba, float* coverage, float* z) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto infinity = hn::Set(d, std::numeric_limits<float>::infinity());
  for (int i = 0; i < n; i += lanes) {
    const float* from = sums + 4 * i;
    auto r = hn::Load(d, from), g = hn::Load(d, from + lanes);
    auto b = hn::Load(d, from + 2 * lanes), weight = hn::Load(d, from + 3 * lanes);
    transpose_blocks(d, r, g, b, weight);
    if (share != nullptr) {
      const auto part = hn::Load(d, share + i);
      r = hn::Mul(r, part);
      g = hn::Mul(g, part);
      b = hn::Mul(b, part);
      weight = hn::Mul(weight, part);
    }
    finish(d, space, full_scale, r, g, b, weight);
    const auto covered = present == nullptr ? weight : hn::Mul(weight, hn::Load(d, present + i));
    auto depth = infinity;
    if (!at_infinity) {
      const auto steps = iota_from(d, i - along.start);
      const auto slope = values(d, along, steps);
      const auto seen = hn::And(hn::Gt(weight, hn::Zero(d)), hn::Gt(slope, hn::Set(d, 1e-30F)));
      depth = hn::IfThenElse(seen, reciprocal(d, slope), infinity);
    }
    if (i + lanes <= room) {
      hn::StoreInterleaved4(r, g, b, weight, d, rgba + 4 * i);
      hn::StoreU(covered, d, coverage + i);
      hn::StoreU(depth, d, z + i);
    } else {
      Pixels last;
      hn::StoreInterleaved4(r, g, b, weight, d, last.rgba);
      hn::Store(covered, d, last.coverage);
      hn::Store(depth, d, last.z);
      std::copy_n(last.rgba, 4 * (n - i), rgba + 4 * i);
      std::copy_n(last.coverage, n - i, coverage + i);
      std::copy_n(last.z, n - i, z + i);
    }
  }
}

/// Writes sums in the order of transpose_blocks() as R, G, B, weight per pixel, times `share`
/// unless that is null.
HWY_INLINE void store_sums(const float* sums, const float* share, int n, float* rgba) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::FixedTag<float, 4> d;
  for (int i = 0; i < n; ++i) {
    const auto sum = hn::Load(d, sums + 4 * transposed_index(hn::ScalableTag<float>(), i));
    const auto part = hn::Set(d, share == nullptr ? 1.0F : share[i]);
    hn::StoreU(hn::Mul(sum, part), d, rgba + static_cast<std::ptrdiff_t>(i) * 4);
  }
}

/// Reads what store_sums() writes.
HWY_INLINE void load_sums(const float* rgba, int n, float* sums) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::FixedTag<float, 4> d;
  const int lanes = static_cast<int>(hn::Lanes(hn::ScalableTag<float>()));
  std::fill_n(sums, 4 * ((n + lanes - 1) / lanes * lanes), 0.0F);  // whole vectors
  for (int i = 0; i < n; ++i) {
    hn::Store(hn::LoadU(d, rgba + static_cast<std::ptrdiff_t>(i) * 4), d,
              sums + 4 * transposed_index(hn::ScalableTag<float>(), i));
  }
}

/// Marks the pixels that taps read with a weight above 0.
HWY_INLINE void mark_pixels(const SourceView& source, const Taps& taps, int n) {
  for (int i = 0; i < n; ++i) {
    if (!(taps.share[i] > 0)) continue;
    std::uint8_t* at = source.read_pixels + taps.pixel[i];
    const TapWeights weights = tap_weights(taps, i);
    const auto mark = [](std::uint8_t& pixel, int weight) {
      if (weight != 0) std::atomic_ref(pixel).store(1, std::memory_order_relaxed);
    };
    mark(at[0], weights.upper_left);
    mark(at[1], weights.upper_right);
    mark(at[source.width], weights.lower_left);
    mark(at[source.width + 1], weights.lower_right);
  }
}

// NOLINTNEXTLINE(google-readability-namespace-comments)
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#endif  // per target
