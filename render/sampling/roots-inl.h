// SPDX-License-Identifier: Apache-2.0
// Computes approximate reciprocals and square roots with SIMD, several times as fast as exact ones.
// Included once per instruction set, hence Highway's include guard. Errors: see each function.

#if defined(RAYSTAGE_RENDER_SAMPLING_ROOTS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYSTAGE_RENDER_SAMPLING_ROOTS_INL_H
#undef RAYSTAGE_RENDER_SAMPLING_ROOTS_INL_H
#else
#define RAYSTAGE_RENDER_SAMPLING_ROOTS_INL_H
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {

/// Returns 1 / v within 2 units in the last place, for normal v and 1 / v (1e-37 to 1e37).
template <class D, class V>
HWY_INLINE V reciprocal(D d, V v) {
  namespace hn = hwy::HWY_NAMESPACE;
  const auto one = hn::Set(d, 1.0F);
  auto guess = hn::ApproximateReciprocal(v);  // 14 bits with AVX-512, at most 12 elsewhere
  guess = hn::MulAdd(guess, hn::NegMulAdd(v, guess, one), guess);
#if HWY_TARGET > HWY_AVX3  // lesser targets have greater numbers
  guess = hn::MulAdd(guess, hn::NegMulAdd(v, guess, one), guess);
#endif
  return guess;
}

/// Returns sqrt(v) with a relative error of at most 2e-7, for normal v > 0.
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
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#endif  // per target
