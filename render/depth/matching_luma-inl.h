// SPDX-License-Identifier: Apache-2.0
// Samples matching images at vectors of pixel positions. Included once per instruction set by
// Highway, so its include guard toggles.

#if defined(RAYSTAGE_RENDER_DEPTH_MATCHING_LUMA_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYSTAGE_RENDER_DEPTH_MATCHING_LUMA_INL_H
#undef RAYSTAGE_RENDER_DEPTH_MATCHING_LUMA_INL_H
#else
#define RAYSTAGE_RENDER_DEPTH_MATCHING_LUMA_INL_H
#endif

#include <hwy/highway.h>

#include <cstdint>

#include "render/depth/matching_image.h"

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {

/// Bilinear luma at pixel positions within the image, and whether it is known.
template <class D>
struct Luma {
  hwy::HWY_NAMESPACE::Vec<D> code;
  hwy::HWY_NAMESPACE::Mask<D> is_known;
};
template <class D, class V>
HWY_INLINE Luma<D> luma_at(D d, const MatchingImage& image, V u, V v) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::RebindToSigned<D> di;
  const auto half = hn::Set(d, 0.5F), zero = hn::Zero(d);
  const auto last = [&](int size) HWY_ATTR { return hn::Set(d, static_cast<float>(size - 1)); };
  const auto x = hn::Min(hn::Max(hn::Sub(u, half), zero), last(image.width()));
  const auto y = hn::Min(hn::Max(hn::Sub(v, half), zero), last(image.height()));
  const auto column = hn::ConvertTo(di, x), row = hn::ConvertTo(di, y);
  const auto right = hn::Sub(x, hn::ConvertTo(d, column)), down = hn::Sub(y, hn::ConvertTo(d, row));
  const auto at = hn::Add(hn::Mul(row, hn::Set(di, image.width())), column);
  const auto word =
      hn::GatherIndex(di, reinterpret_cast<const std::int32_t*>(image.words()), at);  // NOLINT
  const auto byte = hn::Set(di, 0xFF);
  const auto upper_left = hn::ConvertTo(d, hn::And(word, byte));
  const auto upper_right = hn::ConvertTo(d, hn::And(hn::ShiftRight<8>(word), byte));
  const auto lower_left = hn::ConvertTo(d, hn::And(hn::ShiftRight<16>(word), byte));
  const auto lower_right = hn::ConvertTo(d, hn::And(hn::ShiftRight<24>(word), byte));
  const auto upper = hn::MulAdd(right, hn::Sub(upper_right, upper_left), upper_left);
  const auto lower = hn::MulAdd(right, hn::Sub(lower_right, lower_left), lower_left);
  return {hn::MulAdd(down, hn::Sub(lower, upper), upper),
          hn::RebindMask(d, hn::Ne(word, hn::Zero(di)))};
}

// NOLINTNEXTLINE(google-readability-namespace-comments)
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#endif  // per target
