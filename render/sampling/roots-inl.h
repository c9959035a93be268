// SPDX-License-Identifier: Apache-2.0
// Reciprocals and square roots in vectors, several times as fast as the exact ones. Included once
// per instruction set, as Highway's kernels are: no include guard of the common kind.

#if defined(RAYSTAGE_RENDER_SAMPLING_ROOTS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYSTAGE_RENDER_SAMPLING_ROOTS_INL_H
#undef RAYSTAGE_RENDER_SAMPLING_ROOTS_INL_H
#else
#define RAYSTAGE_RENDER_SAMPLING_ROOTS_INL_H
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace raystage {
namespace HWY_NAMESPACE {

/// 1 / v within 2 units in the last place, for v and 1 / v both normal (1e-37 to 1e37).
template <class D, class V>
HWY_INLINE V reciprocal(D d, V v) {
  namespace hn = hwy::HWY_NAMESPACE;
  const auto one = hn::Set(d, 1.0F);
  auto guess = hn::ApproximateReciprocal(v);  // 14 bits with AVX-512, 12 and less elsewhere
  guess = hn::MulAdd(guess, hn::NegMulAdd(v, guess, one), guess);
#if HWY_TARGET > HWY_AVX3  // lesser targets have greater numbers
  guess = hn::MulAdd(guess, hn::NegMulAdd(v, guess, one), guess);
#endif
  return guess;
}

/// sqrt(v) within 2e-7 of itself, for normal v > 0.
template <class D, class V>
HWY_INLINE V square_root(D d, V v) {
  namespace hn = hwy::HWY_NAMESPACE;
  const auto guess = hn::ApproximateReciprocalSqrt(v);
  const auto half = hn::Mul(guess, hn::Set(d, 0.5F));
  const auto root = hn::Mul(v, guess);
  return hn::MulAdd(hn::NegMulAdd(root, root, v), half, root);
}

// NOLINTNEXTLINE(google-readability-namespace-comments)
}  // namespace HWY_NAMESPACE
}  // namespace raystage
HWY_AFTER_NAMESPACE();

#endif  // per target
