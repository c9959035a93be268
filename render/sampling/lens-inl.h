// SPDX-License-Identifier: Apache-2.0
// Projects ideal image points through a lens into a frame, with SIMD. Included once per instruction
// set, hence Highway's include guard. Cost: constant per point. Must match
// CameraModel::pixel_from_ideal().

#if defined(RAYSTAGE_RENDER_SAMPLING_LENS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYSTAGE_RENDER_SAMPLING_LENS_INL_H
#undef RAYSTAGE_RENDER_SAMPLING_LENS_INL_H
#else
#define RAYSTAGE_RENDER_SAMPLING_LENS_INL_H
#endif

#include <hwy/highway.h>

#include "render/sampling/source_view.h"

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {

/// A frame position in pixels and its visibility, 0 to 1 (0 also for not-a-number).
template <class V>
struct FramePosition {
  V u, v, seen;
};

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
  const auto u = hn::MulAdd(x_ideal, set(source.fx), set(source.cx));
  const auto v = hn::MulAdd(y_ideal, set(source.fy), set(source.cy));
  const auto width = set(static_cast<float>(source.width));
  const auto height = set(static_cast<float>(source.height));
  const auto to_border = hn::Min(hn::Min(u, hn::Sub(width, u)), hn::Min(v, hn::Sub(height, v)));
  seen = hn::Mul(seen, hn::Min(one, hn::Max(zero, hn::Mul(to_border, set(kBorderFade)))));
  // Positions without visibility (also not-a-number) become 0, so that reading them is valid.
  const auto counts = hn::Gt(seen, zero);
  return {hn::IfThenElseZero(counts, u), hn::IfThenElseZero(counts, v),
          hn::IfThenElseZero(counts, seen)};
}

// NOLINTNEXTLINE(google-readability-namespace-comments)
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#endif  // per target
