// SPDX-License-Identifier: Apache-2.0
// Kernels of two-plane light fields (Levoy and Hanrahan; Gortler et al., SIGGRAPH 1996; thesis 2.3,
// appendix A). They interpolate between the samples of the four nodes around a ray (quadrilinear,
// bilinear or nearest), for a run of pixels within one cell of the camera plane. Cost: O(pixels x
// 16) for quadrilinear interpolation. Must match slabs_reference.cpp.
#include "render/slabs/slab_kernels.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "render/sampling/source_view.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/slabs/slab_kernels.cpp"
// The order of these includes matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
// clang-format on

#include "render/sampling/finish-inl.h"

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

/// Pixels per chunk: positions are vectors across pixels, samples are vectors across colours.
constexpr int kChunk = 64;

/// For each pixel of a chunk: the upper left of four samples in a node's image, and their weights
/// (interpolation times the node's weight for the ray).
struct Taps {
  HWY_ALIGN std::int32_t first[kChunk];  // sample index
  HWY_ALIGN float weight00[kChunk], weight01[kChunk], weight10[kChunk], weight11[kChunk];
};

/// A linear function of the pixel from the chunk's first pixel on; the base is computed in double,
/// the steps in float.
struct Ramp {
  float base, step;
};
Ramp ramp(const SlabRun::LinearFunction& function, int x, int y, double scale) {
  return {static_cast<float>((function[0] * (x + 0.5) + (function[1] * (y + 0.5) + function[2])) *
                             scale),
          static_cast<float>(function[0] * scale)};
}

/// Returns a common scale of a run's numerators and denominator, so that they fit in float; only
/// their ratio matters.
double scale_of(const SlabRun::LinearFunction& denominator, int x, int y, int n) {
  const double rest = denominator[1] * (y + 0.5) + denominator[2];
  const double most = std::max(std::abs(denominator[0] * (x + 0.5) + rest),
                               std::abs(denominator[0] * (x + n - 0.5) + rest));
  return most > 0 ? 1 / most : 1;
}

template <class D>
hn::Vec<D> values(D d, Ramp r, hn::Vec<D> steps) {
  return hn::MulAdd(steps, hn::Set(d, r.step), hn::Set(d, r.base));
}

/// Computes, along one axis of the image plane, the first of two samples and the second's weight;
/// `seen` falls from 1 to 0 at the image's border.
template <class D>
struct Place {
  hn::Vec<D> first, second_share, seen;
};

template <class D>
HWY_INLINE Place<D> place(D d, hn::Vec<D> at, int size, bool nearest) {
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0F), half = hn::Set(d, 0.5F);
  const auto extent = hn::Set(d, static_cast<float>(size));
  const auto to_border = hn::Min(at, hn::Sub(extent, at));
  const auto seen = hn::Min(one, hn::Max(zero, hn::Mul(to_border, hn::Set(d, kBorderFade))));
  // Positions without visibility (also not-a-number) become 0, so that reading them is valid.
  const auto counts = hn::Gt(seen, zero);
  const auto offset =
      hn::Min(hn::Max(hn::Sub(hn::IfThenElseZero(counts, at), half), zero), hn::Sub(extent, one));
  const auto first = hn::Floor(offset);
  auto share = hn::Sub(offset, first);
  if (nearest) share = hn::IfThenElseZero(hn::Ge(share, half), one);
  return {first, share, hn::IfThenElseZero(counts, seen)};
}

/// Returns the second node's weight along one axis of the camera plane, 0 to 1.
template <class D>
HWY_INLINE hn::Vec<D> share_of_second(D d, hn::Vec<D> times, hn::Vec<D> inverse, bool nearest) {
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0F);
  const auto share = hn::Min(one, hn::Max(zero, hn::Mul(times, inverse)));
  return nearest ? hn::IfThenElseZero(hn::Ge(share, hn::Set(d, 0.5F)), one) : share;
}

void compute_taps(const SlabRun& run, int begin, int n, Taps (&taps)[4]) {
  using D = hn::ScalableTag<float>;
  const D d;
  const hn::RebindToSigned<D> di;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const bool nearest_node = run.interpolation == SlabInterpolation::kNearest;
  const bool nearest_sample = run.interpolation != SlabInterpolation::kQuadrilinear;
  const double grid_scale = scale_of(run.across, begin, run.y, n);
  const Ramp across = ramp(run.across, begin, run.y, grid_scale);
  const Ramp column = ramp(run.column, begin, run.y, grid_scale);
  const Ramp row = ramp(run.row, begin, run.y, grid_scale);
  const double image_scale = scale_of(run.ahead, begin, run.y, n);
  const Ramp ahead = ramp(run.ahead, begin, run.y, image_scale);
  const Ramp u_ramp[2] = {ramp(run.u[0], begin, run.y, image_scale),
                          ramp(run.u[1], begin, run.y, image_scale)};
  const Ramp v_ramp[2] = {ramp(run.v[0], begin, run.y, image_scale),
                          ramp(run.v[1], begin, run.y, image_scale)};
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0F);
  const auto width = hn::Set(di, run.width);

  for (int i = 0; i < n; i += lanes) {
    const auto steps = hn::Iota(d, static_cast<float>(i));
    const auto den = values(d, across, steps);
    const auto inverse_across = hn::Div(one, hn::IfThenElse(hn::Eq(den, zero), one, den));
    const auto right = share_of_second(d, values(d, column, steps), inverse_across, nearest_node);
    const auto lower = share_of_second(d, values(d, row, steps), inverse_across, nearest_node);
    const auto w = values(d, ahead, steps);
    const auto in_front = hn::Gt(w, zero);
    const auto inverse = hn::Div(one, hn::IfThenElse(in_front, w, one));
    const auto seen_at_all = hn::IfThenElseZero(in_front, one);
    const auto share_x0 = hn::Mul(hn::Sub(one, right), seen_at_all);
    const auto share_x1 = hn::Mul(right, seen_at_all);
    const auto share_y0 = hn::Sub(one, lower), share_y1 = lower;
    const auto at = [&](Ramp numerator) { return hn::Mul(values(d, numerator, steps), inverse); };
    const Place<D> x0 = place(d, at(u_ramp[0]), run.width, nearest_sample);
    const Place<D> x1 = place(d, at(u_ramp[1]), run.width, nearest_sample);
    const Place<D> y0 = place(d, at(v_ramp[0]), run.height, nearest_sample);
    const Place<D> y1 = place(d, at(v_ramp[1]), run.height, nearest_sample);
    const auto store = [&](Taps& out, const Place<D>& x, const Place<D>& y, hn::Vec<D> share_x,
                           hn::Vec<D> share_y) {
      const auto weight = hn::Mul(hn::Mul(share_x, x.seen), hn::Mul(share_y, y.seen));
      const auto below = hn::Mul(weight, y.second_share), above = hn::Sub(weight, below);
      const auto weight11 = hn::Mul(below, x.second_share);
      const auto weight01 = hn::Mul(above, x.second_share);
      hn::Store(hn::Add(hn::Mul(hn::ConvertTo(di, y.first), width), hn::ConvertTo(di, x.first)), di,
                out.first + i);
      hn::Store(hn::Sub(above, weight01), d, out.weight00 + i);
      hn::Store(weight01, d, out.weight01 + i);
      hn::Store(hn::Sub(below, weight11), d, out.weight10 + i);
      hn::Store(weight11, d, out.weight11 + i);
    };
    store(taps[0], x0, y0, share_x0, share_y0);
    store(taps[1], x1, y0, share_x1, share_y0);
    store(taps[2], x0, y1, share_x0, share_y1);
    store(taps[3], x1, y1, share_x1, share_y1);
  }
}

/// Adds the four samples of each tap of a node; `sums`: 4 floats per pixel.
void add_samples(const std::uint16_t* HWY_RESTRICT texels, int width, const Taps& taps, int n,
                 float* HWY_RESTRICT sums) {
  const hn::FixedTag<float, 4> d;
  const hn::Rebind<std::uint16_t, decltype(d)> d16;
  const hn::Rebind<std::int32_t, decltype(d)> d32;
  const auto sample = [&](const std::uint16_t* at) {
    return hn::ConvertTo(d, hn::PromoteTo(d32, hn::LoadU(d16, at)));
  };
  const std::size_t row = static_cast<std::size_t>(width) * 4;
  for (int i = 0; i < n; ++i) {
    const std::uint16_t* upper = texels + static_cast<std::size_t>(taps.first[i]) * 4;
    const std::uint16_t* lower = upper + row;
    auto sum = hn::Load(d, sums + 4 * i);
    sum = hn::MulAdd(hn::Set(d, taps.weight00[i]), sample(upper), sum);
    sum = hn::MulAdd(hn::Set(d, taps.weight01[i]), sample(upper + 4), sum);
    sum = hn::MulAdd(hn::Set(d, taps.weight10[i]), sample(lower), sum);
    sum = hn::MulAdd(hn::Set(d, taps.weight11[i]), sample(lower + 4), sum);
    hn::Store(sum, d, sums + 4 * i);
  }
}

void sample_run(const SlabRun& run, store::BlendSpace space, float full_scale, float* rgba,
                float* z, SumStage mode) {
  Taps taps[4];
  HWY_ALIGN float sums[4 * kChunk];
  for (int begin = run.begin; begin < run.end; begin += kChunk) {
    const int n = std::min(kChunk, run.end - begin);
    float* out = rgba + static_cast<std::size_t>(begin - run.begin) * 4;
    if (mode == SumStage::kFinishOnly) {
      std::copy_n(out, 4 * n, sums);
    } else {
      compute_taps(run, begin, n, taps);
      std::fill(sums, sums + 4 * n, 0.0F);
      for (int c = 0; c < 4; ++c) {
        if (run.node[c] == nullptr) continue;
        add_samples(run.node[c], run.width, taps[c], n, sums);
      }
    }
    const Ramp along = ramp(run.slope, begin, run.y, run.at_infinity ? 1 : 1 / run.distance);
    const auto slope_at = [&](int i) { return along.base + static_cast<float>(i) * along.step; };
    for (int i = 0; i < n; ++i) {
      if (!run.at_infinity && !(slope_at(i) > 0)) std::fill(sums + 4 * i, sums + 4 * i + 4, 0.0F);
    }
    if (mode == SumStage::kSampleOnly) {
      std::copy_n(sums, 4 * n, out);
      continue;
    }
    float* out_z = z + (begin - run.begin);
    for (int i = 0; i < n; ++i) {
      const float slope = slope_at(i);
      out_z[i] = !run.at_infinity && sums[4 * i + 3] > 0 ? 1 / slope
                                                         : std::numeric_limits<float>::infinity();
    }
    finish(sums, n, space, full_scale, out);
  }
}

const char* target() { return hwy::TargetName(HWY_TARGET); }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::render {

HWY_EXPORT(sample_run);
HWY_EXPORT(target);

void sample_slab_run(const SlabRun& run, store::BlendSpace space, float full_scale, float* rgba,
                     float* z, SumStage sums) {
  HWY_DYNAMIC_DISPATCH(sample_run)(run, space, full_scale, rgba, z, sums);
}
const char* slab_kernel_target() { return HWY_DYNAMIC_DISPATCH(target)(); }

}  // namespace raystage::render
#endif
