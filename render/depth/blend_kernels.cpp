// SPDX-License-Identifier: Apache-2.0
// Kernels of the blending by depths, up to 64 pixels at a time. compute_visibility() compares a
// view's points with a camera's inverse depths (bilinear ramp behind the surface), and
// compute_surface_share() also with the ramp in front of it.
// blend_reweighted() computes the mean of the cameras' samples by iteratively reweighted least
// squares with Cauchy weights (2 rounds). Cost: O(pixels x cameras x rounds). Must match the
// per-pixel double computation in depth_reference.cpp.
#include "render/depth/blend_kernels.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/depth/blend_kernels.cpp"
// The order matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
#include "render/depth/transfer-inl.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

/// Returns the values of points within the camera's depths, which fall to 0 at their border if the
/// run has one; 1 beyond them if it has none.
template <class D, class Place, class V>
HWY_INLINE V within_border(D d, const VisibilityRun& run, const Place& place, V values) {
  if (!(run.border > 0)) return hn::IfThenElse(place.inside, values, hn::Set(d, 1.0F));
  const auto width = hn::Set(d, static_cast<float>(run.depths->width));
  const auto height = hn::Set(d, static_cast<float>(run.depths->height));
  const auto nearest = hn::Min(hn::Min(place.u, hn::Sub(width, place.u)),
                               hn::Min(place.v, hn::Sub(height, place.v)));
  const auto part = hn::Min(hn::Set(d, 1.0F), hn::Mul(nearest, hn::Set(d, 1 / run.border)));
  return hn::IfThenElseZero(place.inside, hn::Mul(values, part));
}

void visibility(const VisibilityRun& run) {
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> di;
  const int lanes = static_cast<int>(hn::Lanes(d)), count = static_cast<int>(run.visible.size());
  const int width = run.depths->width, height = run.depths->height;
  const RowTransfer transfer(run.transfer, run.y, width, height);
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0F), half = hn::Set(d, 0.5F);
  const auto last_x = hn::Set(d, static_cast<float>(width - 1));
  const auto last_y = hn::Set(d, static_cast<float>(height - 1));
  const auto right_most = hn::Set(di, width - 1), lowest = hn::Set(di, height - 1);
  const auto next = hn::Set(di, 1), pitch = hn::Set(di, width);
  // (hidden - excess / tolerance) / (hidden - 1), cut off at 0 and 1.
  const auto slope = hn::Set(d, 1 / (run.tolerance * (kOcclusionRamp - 1)));
  const auto top = hn::Set(d, kOcclusionRamp / (kOcclusionRamp - 1));
  const float* values = run.depths->values.data();
  const float* blocks = run.nearest->values.data();
  const auto block_pitch = hn::Set(di, run.nearest->width);
  const auto tolerance = hn::Set(d, run.tolerance);
  HWY_ALIGN float inverse_depth[kMaxRunPixels], visible[kMaxRunPixels];
  std::copy(run.inverse_depth.begin(), run.inverse_depth.end(), inverse_depth);
  std::fill(inverse_depth + count, inverse_depth + std::min(kMaxRunPixels, count + lanes), 0.0F);
  for (int i = 0; i < count; i += lanes) {
    const auto place = transfer.at(d, run.x + i, hn::Load(d, inverse_depth + i));
    const auto u = hn::Min(hn::Max(hn::Sub(place.u, half), zero), last_x);
    const auto v = hn::Min(hn::Max(hn::Sub(place.v, half), zero), last_y);
    const auto x0 = hn::ConvertTo(di, u), y0 = hn::ConvertTo(di, v);
    const auto right = hn::Sub(u, hn::ConvertTo(d, x0)), down = hn::Sub(v, hn::ConvertTo(d, y0));
    const auto x1 = hn::Min(hn::Add(x0, next), right_most), y1 = hn::Min(hn::Add(y0, next), lowest);
    // Skip the bilinear test where no depth of the block is near enough to hide the points.
    const auto block = hn::Add(hn::Mul(hn::ShiftRight<kVisibilityBlockLog2>(y0), block_pitch),
                               hn::ShiftRight<kVisibilityBlockLog2>(x0));
    const auto nearest = hn::GatherIndex(d, blocks, block);
    const auto clear = hn::Le(nearest, hn::Add(place.inverse_depth, tolerance));
    if (hn::AllFalse(d, hn::AndNot(clear, place.inside))) {
      hn::Store(within_border(d, run, place, one), d, visible + i);
      continue;
    }
    const auto sight = [&](auto x, auto y) HWY_ATTR {
      const auto its = hn::GatherIndex(d, values, hn::Add(hn::Mul(y, pitch), x));
      const auto excess = hn::Sub(its, place.inverse_depth);
      return hn::Min(one, hn::Max(zero, hn::NegMulAdd(excess, slope, top)));
    };
    const auto upper_left = sight(x0, y0), lower_left = sight(x0, y1);
    const auto upper = hn::MulAdd(right, hn::Sub(sight(x1, y0), upper_left), upper_left);
    const auto lower = hn::MulAdd(right, hn::Sub(sight(x1, y1), lower_left), lower_left);
    const auto seen = hn::MulAdd(down, hn::Sub(lower, upper), upper);
    hn::Store(within_border(d, run, place, seen), d, visible + i);
  }
  std::copy_n(visible, count, run.visible.begin());
}

void surface_share(const VisibilityRun& run, std::span<float> at_surface) {
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> di;
  const int lanes = static_cast<int>(hn::Lanes(d)), count = static_cast<int>(at_surface.size());
  const int width = run.depths->width, height = run.depths->height;
  const RowTransfer transfer(run.transfer, run.y, width, height);
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0F), half = hn::Set(d, 0.5F);
  const auto last_x = hn::Set(d, static_cast<float>(width - 1));
  const auto last_y = hn::Set(d, static_cast<float>(height - 1));
  const auto right_most = hn::Set(di, width - 1), lowest = hn::Set(di, height - 1);
  const auto next = hn::Set(di, 1), pitch = hn::Set(di, width);
  const auto slope = hn::Set(d, 1 / (run.tolerance * (kOcclusionRamp - 1)));
  const auto top = hn::Set(d, kOcclusionRamp / (kOcclusionRamp - 1));
  const float* values = run.depths->values.data();
  HWY_ALIGN float inverse_depth[kMaxRunPixels] = {}, share[kMaxRunPixels];
  std::copy(run.inverse_depth.begin(), run.inverse_depth.end(), inverse_depth);
  for (int i = 0; i < count; i += lanes) {
    const auto place = transfer.at(d, run.x + i, hn::Load(d, inverse_depth + i));
    const auto u = hn::Min(hn::Max(hn::Sub(place.u, half), zero), last_x);
    const auto v = hn::Min(hn::Max(hn::Sub(place.v, half), zero), last_y);
    const auto x0 = hn::ConvertTo(di, u), y0 = hn::ConvertTo(di, v);
    const auto right = hn::Sub(u, hn::ConvertTo(d, x0)), down = hn::Sub(v, hn::ConvertTo(d, y0));
    const auto x1 = hn::Min(hn::Add(x0, next), right_most), y1 = hn::Min(hn::Add(y0, next), lowest);
    const auto clipped = [&](auto ramp) HWY_ATTR { return hn::Min(one, hn::Max(zero, ramp)); };
    const auto is_there = [&](auto x, auto y) HWY_ATTR {
      const auto its = hn::GatherIndex(d, values, hn::Add(hn::Mul(y, pitch), x));
      const auto excess = hn::Sub(its, place.inverse_depth);
      const auto there = hn::Mul(clipped(hn::NegMulAdd(excess, slope, top)),
                                 clipped(hn::MulAdd(excess, slope, top)));
      return hn::IfThenElse(hn::Lt(its, zero), one, there);
    };
    const auto upper_left = is_there(x0, y0), lower_left = is_there(x0, y1);
    const auto upper = hn::MulAdd(right, hn::Sub(is_there(x1, y0), upper_left), upper_left);
    const auto lower = hn::MulAdd(right, hn::Sub(is_there(x1, y1), lower_left), lower_left);
    const auto all = hn::MulAdd(down, hn::Sub(lower, upper), upper);
    hn::Store(within_border(d, run, place, all), d, share + i);
  }
  std::copy_n(share, count, at_surface.begin());
}

/// RGB, premultiplied by `seen`, for a vector of pixels.
template <class V>
struct Colour {
  V r, g, b, seen;
};

/// The cameras of a run, at a vector of pixels.
template <class D, class V = hn::Vec<D>>
class CamerasAt {
 public:
  CamerasAt(D d, const BlendRun& run, int i) : d_(d), run_(run), i_(i) {}

  /// Sums the samples by weight and visibility; adds to `alpha` the visible weights.
  Colour<V> sum(V& alpha) const {
    Colour<V> sum = nothing();
    for (std::size_t c = 0; c < run_.samples.size(); ++c) {
      const Colour<V> sample = sample_of(c);
      add(weight_of(c), sample, sum);
      const auto shown =
          hn::Mul(hn::LoadU(d_, run_.weights[c] + i_), hn::LoadU(d_, run_.visible[c] + i_));
      alpha = hn::MulAdd(shown, sample.seen, alpha);
    }
    return sum;
  }

  /// Sums the samples also by agreement with the mean of `of_all`.
  Colour<V> sum_reweighted(const Colour<V>& of_all) const {
    const auto tiny = hn::Set(d_, 1e-30F);
    // Samples are premultiplied by seen * 65535, and so is the mean.
    const auto per_agreement =
        hn::Set(d_, 65535.0F * 65535.0F / (3 * run_.agreement * run_.agreement));
    const auto per_weight = hn::Div(hn::Set(d_, 1.0F), hn::Max(of_all.seen, tiny));
    const auto r = hn::Mul(of_all.r, per_weight), g = hn::Mul(of_all.g, per_weight);
    const auto b = hn::Mul(of_all.b, per_weight);
    Colour<V> sum = nothing();
    for (std::size_t c = 0; c < run_.samples.size(); ++c) {
      const Colour<V> sample = sample_of(c);
      const auto off_r = hn::NegMulAdd(r, sample.seen, sample.r);
      const auto off_g = hn::NegMulAdd(g, sample.seen, sample.g);
      const auto off_b = hn::NegMulAdd(b, sample.seen, sample.b);
      const auto square = hn::MulAdd(off_r, off_r, hn::MulAdd(off_g, off_g, hn::Mul(off_b, off_b)));
      const auto seen = hn::Mul(sample.seen, sample.seen);
      const auto trust = hn::Div(seen, hn::Max(hn::MulAdd(square, per_agreement, seen), tiny));
      add(hn::Mul(weight_of(c), trust), sample, sum);
    }
    return sum;
  }

 private:
  Colour<V> nothing() const {
    const auto zero = hn::Zero(d_);
    return {zero, zero, zero, zero};
  }
  Colour<V> sample_of(std::size_t c) const {
    Colour<V> sample;
    hn::LoadInterleaved4(d_, run_.samples[c] + 4 * i_, sample.r, sample.g, sample.b, sample.seen);
    return sample;
  }
  V weight_of(std::size_t c) const {
    return hn::Mul(hn::LoadU(d_, run_.weights[c] + i_),
                   hn::Add(hn::LoadU(d_, run_.visible[c] + i_), hn::Set(d_, kMinVisibleWeight)));
  }
  static void add(V weight, const Colour<V>& sample, Colour<V>& sum) {
    sum.r = hn::MulAdd(weight, sample.r, sum.r);
    sum.g = hn::MulAdd(weight, sample.g, sum.g);
    sum.b = hn::MulAdd(weight, sample.b, sum.b);
    sum.seen = hn::MulAdd(weight, sample.seen, sum.seen);
  }

  D d_;
  const BlendRun& run_;
  int i_;
};

/// Writes a vector of colours, up to the end of the run.
template <class D, class V>
void write(D d, const Colour<V>& colour, int i, int count, std::span<float> to) {
  if (i + static_cast<int>(hn::Lanes(d)) <= count) {
    hn::StoreInterleaved4(colour.r, colour.g, colour.b, colour.seen, d, to.data() + 4 * i);
    return;
  }
  HWY_ALIGN float last[4 * hn::MaxLanes(d)];
  hn::StoreInterleaved4(colour.r, colour.g, colour.b, colour.seen, d, last);
  std::copy_n(last, 4 * (count - i), to.data() + 4 * i);
}

void blend(const BlendRun& run, std::span<float> sums) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto zero = hn::Zero(d), tiny = hn::Set(d, 1e-30F);
  for (int i = 0; i < run.count; i += lanes) {
    const CamerasAt<decltype(d)> cameras(d, run, i);
    auto alpha = zero;
    auto sum = cameras.sum(alpha);
    for (int round = 0; round < kReweightingRounds; ++round) sum = cameras.sum_reweighted(sum);
    const auto scale =
        hn::IfThenElseZero(hn::Gt(sum.seen, zero), hn::Div(alpha, hn::Max(sum.seen, tiny)));
    sum.r = hn::Mul(sum.r, scale);
    sum.g = hn::Mul(sum.g, scale);
    sum.b = hn::Mul(sum.b, scale);
    sum.seen = hn::Mul(sum.seen, scale);
    write(d, sum, i, run.count, sums);
  }
}

void first_sums(const BlendRun& run, std::span<float> sums, std::span<float> alphas) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  HWY_ALIGN float last[kMaxRunPixels + hn::MaxLanes(d)];
  for (int i = 0; i < run.count; i += lanes) {
    auto alpha = hn::Zero(d);
    write(d, CamerasAt<decltype(d)>(d, run, i).sum(alpha), i, run.count, sums);
    hn::StoreU(alpha, d, last + i);
  }
  std::copy_n(last, run.count, alphas.begin());
}

void next_sums(const BlendRun& run, std::span<const float> of_all, std::span<float> sums) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  HWY_ALIGN float all[4 * (kMaxRunPixels + hn::MaxLanes(d))] = {};
  std::copy_n(of_all.begin(), 4 * run.count, all);
  for (int i = 0; i < run.count; i += lanes) {
    Colour<hn::Vec<decltype(d)>> mean;
    hn::LoadInterleaved4(d, all + 4 * i, mean.r, mean.g, mean.b, mean.seen);
    write(d, CamerasAt<decltype(d)>(d, run, i).sum_reweighted(mean), i, run.count, sums);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::render {

HWY_EXPORT(visibility);
HWY_EXPORT(surface_share);
HWY_EXPORT(blend);
HWY_EXPORT(first_sums);
HWY_EXPORT(next_sums);

void compute_visibility(const VisibilityRun& run) { HWY_DYNAMIC_DISPATCH(visibility)(run); }
void compute_surface_share(const VisibilityRun& run, std::span<float> at_surface) {
  HWY_DYNAMIC_DISPATCH(surface_share)(run, at_surface);
}
void blend_reweighted(const BlendRun& run, std::span<float> sums) {
  HWY_DYNAMIC_DISPATCH(blend)(run, sums);
}
void sum_weighted(const BlendRun& run, std::span<float> sums, std::span<float> alpha) {
  HWY_DYNAMIC_DISPATCH(first_sums)(run, sums, alpha);
}
void sum_reweighted(const BlendRun& run, std::span<const float> of_all, std::span<float> sums) {
  HWY_DYNAMIC_DISPATCH(next_sums)(run, of_all, sums);
}

}  // namespace raystage::render
#endif
