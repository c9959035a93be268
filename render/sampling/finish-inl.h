// SPDX-License-Identifier: Apache-2.0
// Converts sums of samples to pixels of a view, with SIMD. Included once per instruction set, hence
// Highway's include guard. Input: sums of weighted codes; output: premultiplied linear light. Cost:
// O(pixels). Must match premultiplied_light() (reference_renderer.cpp).

#if defined(RAYSTAGE_RENDER_SAMPLING_FINISH_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYSTAGE_RENDER_SAMPLING_FINISH_INL_H
#undef RAYSTAGE_RENDER_SAMPLING_FINISH_INL_H
#else
#define RAYSTAGE_RENDER_SAMPLING_FINISH_INL_H
#endif

// The order of these includes matters.
// clang-format off
#include <hwy/highway.h>
#include <hwy/contrib/math/math-inl.h>
#include "render/sampling/roots-inl.h"
// clang-format on

#include <algorithm>

#include "store/processing/frames/blend_space.h"

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {

/// Returns linear light for blended sRGB codes (IEC 61966-2-1). With b the base of the power 2.4
/// and s its square root, b^2.4 = s^4 s^0.8. The factor s^0.8 is approximated by a minimax
/// polynomial of degree 6 on [0.3, 1], exact at 1 (white stays white). The relative error is at
/// most 3e-6; that of half floats, in which views are written, is 2.4e-4.
template <class D, class V>
HWY_INLINE V linear_from_codes(D d, V code) {
  namespace hn = hwy::HWY_NAMESPACE;
  const auto set = [&](float value) HWY_ATTR { return hn::Set(d, value); };
  const auto straight = hn::Mul(code, set(1 / 12.92F));
  const auto base = hn::MulAdd(hn::Max(code, hn::Zero(d)), set(1 / 1.055F), set(0.055F / 1.055F));
  const auto s = square_root(d, base);
  auto power = hn::MulAdd(s, set(-0.121430062F), set(0.566481233F));
  power = hn::MulAdd(s, power, set(-1.13577688F));
  power = hn::MulAdd(s, power, set(1.30752921F));
  power = hn::MulAdd(s, power, set(-1.03540647F));
  power = hn::MulAdd(s, power, set(1.38732731F));
  power = hn::MulAdd(s, power, set(0.0312757269F));
  const auto curved = hn::Mul(hn::Mul(base, base), power);
  return hn::IfThenElse(hn::Le(code, set(0.04045F)), straight, curved);
}

/// Returns the power 2.4 of codes of BlendSpace::kHighRange, 0 for codes below 1e-9. The relative
/// error is at most 1e-5: those of Log and Exp, times the logarithm.
template <class D, class V>
HWY_INLINE V linear_from_powers(D d, V code) {
  namespace hn = hwy::HWY_NAMESPACE;
  const auto least = hn::Set(d, 1e-9F);
  const auto power = hn::Exp(d, hn::Mul(hn::Log(d, hn::Max(code, least)), hn::Set(d, 2.4F)));
  return hn::IfThenElseZero(hn::Gt(code, least), power);
}

/// Converts sums of weighted codes, 0 to 65535, to premultiplied linear light; `weight` to alpha.
template <class D, class V>
HWY_INLINE void finish(D d, store::BlendSpace space, float full_scale, V& r, V& g, V& b,
                       V& weight) {
  namespace hn = hwy::HWY_NAMESPACE;
  const auto alpha = hn::Mul(weight, hn::Set(d, 1.0F / 65535));
  if (space != store::BlendSpace::kLinear) {
    const auto inverse = reciprocal(d, hn::Max(weight, hn::Set(d, 1e-20F)));
    const auto scale = hn::Mul(alpha, hn::Set(d, full_scale));
    if (space == store::BlendSpace::kHighRange) {
      r = hn::Mul(linear_from_powers(d, hn::Mul(r, inverse)), scale);
      g = hn::Mul(linear_from_powers(d, hn::Mul(g, inverse)), scale);
      b = hn::Mul(linear_from_powers(d, hn::Mul(b, inverse)), scale);
      weight = alpha;
      return;
    }
    r = hn::Mul(linear_from_codes(d, hn::Mul(r, inverse)), scale);
    g = hn::Mul(linear_from_codes(d, hn::Mul(g, inverse)), scale);
    b = hn::Mul(linear_from_codes(d, hn::Mul(b, inverse)), scale);
  } else {
    const auto scale = hn::Set(d, full_scale / 65535);
    r = hn::Mul(r, scale);
    g = hn::Mul(g, scale);
    b = hn::Mul(b, scale);
  }
  weight = alpha;
}

/// Converts n pixels of R, G, B, weight. `rgba` may be `sums`.
HWY_INLINE void finish(const float* sums, int n, store::BlendSpace space, float full_scale,
                       float* rgba) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto finish_vector = [&](const float* from, float* to) HWY_ATTR {
    hn::Vec<decltype(d)> r, g, b, weight;
    hn::LoadInterleaved4(d, from, r, g, b, weight);
    finish(d, space, full_scale, r, g, b, weight);
    hn::StoreInterleaved4(r, g, b, weight, d, to);
  };
  int i = 0;
  for (; i + lanes <= n; i += lanes) finish_vector(sums + 4 * i, rgba + 4 * i);
  if (i == n) return;
  HWY_ALIGN float last[4 * hn::MaxLanes(d)] = {};
  std::copy(sums + 4 * i, sums + 4 * n, last);
  finish_vector(last, last);
  std::copy_n(last, 4 * (n - i), rgba + 4 * i);
}

// NOLINTNEXTLINE(google-readability-namespace-comments)
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#endif  // per target
