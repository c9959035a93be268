// SPDX-License-Identifier: Apache-2.0
// Projects ideal image points through a lens into a frame, with SIMD. Included once per instruction
// set, hence Highway's include guard. Cost: constant per point. Must match CameraModel::project().

#if defined(RAYSTAGE_RENDER_SAMPLING_LENS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYSTAGE_RENDER_SAMPLING_LENS_INL_H
#undef RAYSTAGE_RENDER_SAMPLING_LENS_INL_H
#else
#define RAYSTAGE_RENDER_SAMPLING_LENS_INL_H
#endif

#include <hwy/highway.h>

#include <iterator>
#include <numbers>

#include "render/sampling/source_view.h"

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {

/// A frame position in pixels and its visibility, 0 to 1 (0 also for not-a-number).
template <class V>
struct FramePosition {
  V u, v, seen;
};

/// Returns frame positions whose visibility `seen` falls to 0 at the frame's border.
template <class D, class V>
HWY_INLINE FramePosition<V> fade_at_border(D d, const SourceView& source, V u, V v, V seen) {
  namespace hn = hwy::HWY_NAMESPACE;
  const auto one = hn::Set(d, 1.0F), zero = hn::Zero(d);
  const auto width = hn::Set(d, static_cast<float>(source.width));
  const auto height = hn::Set(d, static_cast<float>(source.height));
  const auto to_border = hn::Min(hn::Min(u, hn::Sub(width, u)), hn::Min(v, hn::Sub(height, v)));
  seen = hn::Mul(seen, hn::Min(one, hn::Max(zero, hn::Mul(to_border, hn::Set(d, kBorderFade)))));
  // Positions without visibility (also not-a-number) become 0, so that reading them is valid.
  const auto counts = hn::Gt(seen, zero);
  return {hn::IfThenElseZero(counts, u), hn::IfThenElseZero(counts, v),
          hn::IfThenElseZero(counts, seen)};
}

/// Returns the frame positions of ideal image points (Brown-Conrady). Their visibility falls to 0
/// at the frame's border and at the limit of the lens model.
template <class D, class V, class M>
HWY_INLINE FramePosition<V> project_through_lens(D d, const SourceView& source, V x_ideal,
                                                 V y_ideal, M in_front) {
  namespace hn = hwy::HWY_NAMESPACE;
  const auto set = [&](float value) HWY_ATTR { return hn::Set(d, value); };
  const auto one = set(1), zero = hn::Zero(d);
  auto seen = hn::IfThenElseZero(in_front, one);
  if (source.distorted) {
    const auto xx = hn::Mul(x_ideal, x_ideal), yy = hn::Mul(y_ideal, y_ideal);
    const auto xy2 = hn::Mul(set(2), hn::Mul(x_ideal, y_ideal));
    const auto rr = hn::Add(xx, yy);
    auto radial = hn::MulAdd(rr, set(source.k3), set(source.k2));
    radial = hn::MulAdd(rr, radial, set(source.k1));
    radial = hn::MulAdd(rr, radial, one);
    const auto tangential_x =
        hn::MulAdd(set(source.p1), xy2, hn::Mul(set(source.p2), hn::MulAdd(set(2), xx, rr)));
    const auto tangential_y =
        hn::MulAdd(set(source.p2), xy2, hn::Mul(set(source.p1), hn::MulAdd(set(2), yy, rr)));
    x_ideal = hn::MulAdd(x_ideal, radial, tangential_x);
    y_ideal = hn::MulAdd(y_ideal, radial, tangential_y);
    // 1 - 0 without a fold.
    const auto room = hn::Sub(one, hn::Mul(rr, set(1.0F / source.fold_radius_squared)));
    seen = hn::Mul(seen, hn::Min(one, hn::Max(zero, hn::Mul(room, set(kFoldFade)))));
  }
  return fade_at_border(d, source, hn::MulAdd(x_ideal, set(source.fx), set(source.cx)),
                        hn::MulAdd(y_ideal, set(source.fy), set(source.cy)), seen);
}

/// Returns atan(t) / t of t^2 in [0, 1]; the error is below 1e-7.
template <class D, class V>
HWY_INLINE V arctangent_per_argument(D d, V square) {
  namespace hn = hwy::HWY_NAMESPACE;
  // Interpolates at Chebyshev's nodes of [0, 1].
  constexpr float kFactors[] = {0.999999997F,  -0.333332763F,  0.199980753F,  -0.142600161F,
                                0.109323415F,  -0.0834972496F, 0.0570895559F, -0.0303518647F,
                                0.0104876492F, -0.00170117006F};
  auto sum = hn::Set(d, kFactors[std::size(kFactors) - 1]);
  for (int i = static_cast<int>(std::size(kFactors)) - 2; i >= 0; --i) {
    sum = hn::MulAdd(sum, square, hn::Set(d, kFactors[i]));
  }
  return sum;
}

/// Returns the frame positions of directions (x right, y down, w ahead, any length below 1e18)
/// through a fisheye lens, which may see behind its own plane. Their visibility falls to 0 at the
/// frame's border and at the largest angle.
template <class D, class V>
HWY_INLINE FramePosition<V> project_through_fisheye(D d, const SourceView& source, V x, V y, V w) {
  namespace hn = hwy::HWY_NAMESPACE;
  const auto set = [&](float value) HWY_ATTR { return hn::Set(d, value); };
  const auto one = set(1), zero = hn::Zero(d);
  // The angle to the axis is 2 atan(across / (length + |w|)), or that to its opposite; this has no
  // cancellation anywhere.
  const auto across_squared = hn::MulAdd(x, x, hn::Mul(y, y));
  const auto length = hn::Sqrt(hn::MulAdd(w, w, across_squared));
  const auto per_sum = hn::Div(one, hn::Max(hn::Add(length, hn::Abs(w)), set(1e-30F)));
  const auto square = hn::Mul(across_squared, hn::Mul(per_sum, per_sum));
  const auto per_across =  // the angle to the axis or its opposite, divided by the way across
      hn::Mul(set(2), hn::Mul(arctangent_per_argument(d, square), per_sum));
  const auto across = hn::Sqrt(across_squared);
  const auto is_behind = hn::Lt(w, zero);
  const auto acute = hn::Mul(per_across, across);
  const auto angle =
      hn::IfThenElse(is_behind, hn::Sub(set(std::numbers::pi_v<float>), acute), acute);
  const auto angle_per_across =
      hn::IfThenElse(is_behind, hn::Div(angle, hn::Max(across, set(1e-30F))), per_across);
  const auto part = hn::Mul(hn::Mul(angle, angle), set(source.fisheye.per_largest_squared));
  const auto s = hn::MulSub(set(2), part, one);
  auto scale = set(source.fisheye.distance_per_angle[FisheyeFit::kTerms - 1]);
  for (int i = FisheyeFit::kTerms - 2; i >= 0; --i) {
    scale = hn::MulAdd(scale, s, set(source.fisheye.distance_per_angle[i]));
  }
  scale = hn::Mul(scale, angle_per_across);
  const auto room = hn::Mul(hn::Sub(one, part), set(kFoldFade));
  return fade_at_border(d, source, hn::MulAdd(hn::Mul(x, scale), set(source.fx), set(source.cx)),
                        hn::MulAdd(hn::Mul(y, scale), set(source.fy), set(source.cy)),
                        hn::Min(one, hn::Max(zero, room)));
}

// NOLINTNEXTLINE(google-readability-namespace-comments)
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#endif  // per target
