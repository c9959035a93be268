// SPDX-License-Identifier: Apache-2.0
// From sums of samples to pixels of a view, in vectors. Included once per instruction set, as
// Highway's kernels are: no include guard of the common kind.

#if defined(RAYSTAGE_RENDER_SAMPLING_FINISH_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYSTAGE_RENDER_SAMPLING_FINISH_INL_H
#undef RAYSTAGE_RENDER_SAMPLING_FINISH_INL_H
#else
#define RAYSTAGE_RENDER_SAMPLING_FINISH_INL_H
#endif

// The order matters.
// clang-format off
#include <hwy/highway.h>
#include <hwy/contrib/math/math-inl.h>
// clang-format on

#include <algorithm>

#include "store/frames/blend_space.h"

HWY_BEFORE_NAMESPACE();
namespace raystage {
namespace HWY_NAMESPACE {

/// sRGB's curve, from blended codes back to linear light (IEC 61966-2-1).
template <class D, class V>
HWY_INLINE V linear_from_codes(D d, V code) {
  namespace hn = hwy::HWY_NAMESPACE;
  const auto set = [&](float value) HWY_ATTR { return hn::Set(d, value); };
  const auto straight = hn::Mul(code, set(1 / 12.92F));
  const auto base = hn::MulAdd(code, set(1 / 1.055F), set(0.055F / 1.055F));
  const auto curved = hn::Exp(d, hn::Mul(set(2.4F), hn::Log(d, base)));
  return hn::IfThenElse(hn::Le(code, set(0.04045F)), straight, curved);
}

/// Sums of weighted codes, 0 to 65535 (R, G, B, weight a pixel; aligned), become premultiplied
/// linear light.
HWY_INLINE void finish(const float* HWY_RESTRICT sums, int n, BlendSpace space, float full_scale,
                       float* HWY_RESTRICT rgba) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::ScalableTag<float> d;
  const hn::RebindToUnsigned<decltype(d)> du;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto unit = hn::Set(d, 1.0F / 65535), scale = hn::Set(d, full_scale);
  const auto three = hn::Set(du, 3);
  const auto is_alpha = hn::RebindMask(d, hn::Eq(hn::And(hn::Iota(du, 0), three), three));
  HWY_ALIGN float last[16];
  for (int i = 0; i < 4 * n; i += lanes) {
    const auto sum = hn::Mul(hn::Load(d, sums + i), unit);
    auto colour = hn::Mul(sum, scale);
    if (space == BlendSpace::kPerceptual) {
      const auto alpha = hn::Broadcast<3>(sum);
      const auto code = hn::Div(sum, hn::Max(alpha, hn::Set(d, 1e-20F)));
      colour = hn::Mul(linear_from_codes(d, code), hn::Mul(alpha, scale));
    }
    const auto out = hn::IfThenElse(is_alpha, sum, colour);
    if (i + lanes <= 4 * n) {
      hn::StoreU(out, d, rgba + i);
    } else {
      hn::Store(out, d, last);
      std::copy(last, last + (4 * n - i), rgba + i);
    }
  }
}

// NOLINTNEXTLINE(google-readability-namespace-comments)
}  // namespace HWY_NAMESPACE
}  // namespace raystage
HWY_AFTER_NAMESPACE();

#endif  // per target
