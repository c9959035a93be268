// SPDX-License-Identifier: Apache-2.0
// From sums of samples to pixels of a view, in vectors. Included once per instruction set, as
// Highway's kernels are: no include guard of the common kind.

#if defined(RAYSTAGE_RENDER_SAMPLING_FINISH_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYSTAGE_RENDER_SAMPLING_FINISH_INL_H
#undef RAYSTAGE_RENDER_SAMPLING_FINISH_INL_H
#else
#define RAYSTAGE_RENDER_SAMPLING_FINISH_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>

#include "store/frames/blend_space.h"

HWY_BEFORE_NAMESPACE();
namespace raystage {
namespace HWY_NAMESPACE {

/// sRGB's curve, from blended codes back to linear light (IEC 61966-2-1). With b the base of the
/// power 2.4 and s its root, b^2.4 = s^4 s^0.8, and s^0.8 is nearly straight: a polynomial of
/// degree 5 on [0.3, 1] (Remez, relative) keeps the result within 1.2e-5 of itself; half floats,
/// which views are written in, keep 2.4e-4.
template <class D, class V>
HWY_INLINE V linear_from_codes(D d, V code) {
  namespace hn = hwy::HWY_NAMESPACE;
  const auto set = [&](float value) HWY_ATTR { return hn::Set(d, value); };
  const auto straight = hn::Mul(code, set(1 / 12.92F));
  const auto base = hn::MulAdd(hn::Max(code, hn::Zero(d)), set(1 / 1.055F), set(0.055F / 1.055F));
  const auto s = hn::Sqrt(base);
  auto power = hn::MulAdd(s, set(0.10675605F), set(-0.43322344F));
  power = hn::MulAdd(s, power, set(0.75412148F));
  power = hn::MulAdd(s, power, set(-0.79887513F));
  power = hn::MulAdd(s, power, set(1.33537539F));
  power = hn::MulAdd(s, power, set(0.03585661F));
  const auto curved = hn::Mul(hn::Mul(base, base), power);
  return hn::IfThenElse(hn::Le(code, set(0.04045F)), straight, curved);
}

/// One vector of pixels: finish() below.
template <class D>
HWY_INLINE void finish_vector(D d, const float* sums, BlendSpace space, float full_scale,
                              float* rgba, float* alpha_out) {
  namespace hn = hwy::HWY_NAMESPACE;
  const auto unit = hn::Set(d, 1.0F / 65535), scale = hn::Set(d, full_scale);
  hn::Vec<D> r, g, b, a;
  hn::LoadInterleaved4(d, sums, r, g, b, a);
  const auto alpha = hn::Mul(a, unit);
  if (space == BlendSpace::kPerceptual) {
    const auto inverse = hn::Div(hn::Set(d, 1.0F), hn::Max(a, hn::Set(d, 1e-20F)));
    const auto weight = hn::Mul(alpha, scale);
    r = hn::Mul(linear_from_codes(d, hn::Mul(r, inverse)), weight);
    g = hn::Mul(linear_from_codes(d, hn::Mul(g, inverse)), weight);
    b = hn::Mul(linear_from_codes(d, hn::Mul(b, inverse)), weight);
  } else {
    const auto weight = hn::Mul(unit, scale);
    r = hn::Mul(r, weight);
    g = hn::Mul(g, weight);
    b = hn::Mul(b, weight);
  }
  hn::StoreInterleaved4(r, g, b, alpha, d, rgba);
  if (alpha_out != nullptr) hn::StoreU(alpha, d, alpha_out);
}

/// Sums of weighted codes, 0 to 65535 (R, G, B, weight a pixel), become premultiplied linear light.
/// `rgba` may be `sums`. `alpha`, once more by itself, or null.
HWY_INLINE void finish(const float* sums, int n, BlendSpace space, float full_scale, float* rgba,
                       float* alpha = nullptr) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  int i = 0;
  for (; i + lanes <= n; i += lanes) {
    finish_vector(d, sums + 4 * i, space, full_scale, rgba + 4 * i,
                  alpha == nullptr ? nullptr : alpha + i);
  }
  if (i == n) return;
  HWY_ALIGN float last[4 * hn::MaxLanes(d)] = {}, last_alpha[hn::MaxLanes(d)];
  std::copy(sums + 4 * i, sums + 4 * n, last);
  finish_vector(d, last, space, full_scale, last, last_alpha);
  std::copy_n(last, 4 * (n - i), rgba + 4 * i);
  if (alpha != nullptr) std::copy_n(last_alpha, n - i, alpha + i);
}

// NOLINTNEXTLINE(google-readability-namespace-comments)
}  // namespace HWY_NAMESPACE
}  // namespace raystage
HWY_AFTER_NAMESPACE();

#endif  // per target
