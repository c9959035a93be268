// SPDX-License-Identifier: Apache-2.0
// Fits a quadratic polynomial over the positions of the cameras to their samples of a point, up to
// 64 pixels at a time: moving least squares (Lancaster and Salkauskas 1981), evaluated at the view.
// Per pixel: the weighted mean, the normal equations of the differences from it (the terms x, y,
// x^2, x y, y^2, 1), and their elimination from x on. The last pivot and right hand side give the
// constant term; the eliminated parts give the residual. Input and output: angular_fit_kernels.h.
// Cost: O(pixels x cameras x terms^2 / 2). Must match angular_fit_reference.cpp.
#include "render/depth/angular_fit_kernels.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/depth/angular_fit_kernels.cpp"
// The order matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr int kMoments = kAngularTerms * (kAngularTerms + 1) / 2;
constexpr int kLast = kAngularTerms - 1;  // the constant term

/// Returns the index of row i, column j <= i of a lower triangle.
constexpr int triangle(int i, int j) { return i * (i + 1) / 2 + j; }

/// The normal equations of a vector of pixels. In memory: vectors may have no size at compile time.
template <class D, class V = hn::Vec<D>>
class AngularEquations {
 public:
  explicit AngularEquations(D d) : d_(d) {
    std::fill_n(matrix_, kMoments * kStride, 0.0F);
    std::fill_n(right_, 3 * kAngularTerms * kStride, 0.0F);
  }
  void add(V weight, V x, V y, V r, V g, V b) {
    HWY_ALIGN float terms[kAngularTerms * kStride];
    const auto store = [&](int i, V value) HWY_ATTR { hn::Store(value, d_, terms + i * kStride); };
    store(0, x);
    store(1, y);
    store(2, hn::Mul(x, x));
    store(3, hn::Mul(x, y));
    store(4, hn::Mul(y, y));
    store(5, hn::Set(d_, 1.0F));
    for (int i = 0; i < kAngularTerms; ++i) {
      const V weighted = hn::Mul(weight, hn::Load(d_, terms + i * kStride));
      for (int j = 0; j <= i; ++j) {
        add_to(matrix_ + triangle(i, j) * kStride, weighted, hn::Load(d_, terms + j * kStride));
      }
      add_to(right_ + (3 * i) * kStride, weighted, r);
      add_to(right_ + (3 * i + 1) * kStride, weighted, g);
      add_to(right_ + (3 * i + 2) * kStride, weighted, b);
    }
  }
  /// Eliminates all terms. Returns the sum of the squares that they explain.
  V eliminate(V ridge) {
    V explained = hn::Zero(d_);
    for (int i = 0; i < kLast; ++i) {
      float* pivot = matrix_ + triangle(i, i) * kStride;
      hn::Store(hn::Add(hn::Load(d_, pivot), ridge), d_, pivot);
    }
    for (int k = 0; k < kAngularTerms; ++k) {
      const V inverse = hn::Div(hn::Set(d_, 1.0F), pivot(k));
      for (int c = 0; c < 3; ++c) {
        explained = hn::MulAdd(hn::Mul(right(k, c), right(k, c)), inverse, explained);
      }
      for (int i = k + 1; i < kAngularTerms; ++i) {
        const V factor =
            hn::Neg(hn::Mul(hn::Load(d_, matrix_ + triangle(i, k) * kStride), inverse));
        for (int j = k + 1; j <= i; ++j) {
          add_to(matrix_ + triangle(i, j) * kStride, factor,
                 hn::Load(d_, matrix_ + triangle(j, k) * kStride));
        }
        for (int c = 0; c < 3; ++c) add_to(right_ + (3 * i + c) * kStride, factor, right(k, c));
      }
    }
    return explained;
  }
  V pivot(int i) const { return hn::Load(d_, matrix_ + triangle(i, i) * kStride); }
  V right(int i, int channel) const { return hn::Load(d_, right_ + (3 * i + channel) * kStride); }

 private:
  static constexpr int kStride = static_cast<int>(hn::MaxLanes(D()));

  void add_to(float* sum, V a, V b) const {
    hn::Store(hn::MulAdd(a, b, hn::Load(d_, sum)), d_, sum);
  }

  D d_;
  HWY_ALIGN float matrix_[kMoments * kStride];
  HWY_ALIGN float right_[3 * kAngularTerms * kStride];
};

/// A camera at a vector of pixels.
template <class V>
struct AngularCamera {
  V weight, seen, x, y, r, g, b;
};

template <class D, class V = hn::Vec<D>>
AngularCamera<V> angular_camera(D d, const AngularRun& run, std::size_t c, int i, V slope,
                                V inverse_depth) {
  AngularCamera<V> at;
  const auto zero = hn::Zero(d), tiny = hn::Set(d, 1e-30F);
  const AngularOffset& offset = run.offsets[c];
  const auto ahead = hn::Set(d, offset.ahead);
  const auto distance = hn::NegMulAdd(hn::Set(d, offset.ahead_m), inverse_depth, hn::Set(d, 1.0F));
  const auto scale = hn::Div(hn::Set(d, 1.0F), hn::Max(distance, hn::Set(d, kMinAngularDistance)));
  at.x = hn::Mul(hn::NegMulAdd(slope, ahead, hn::Set(d, offset.right)), scale);
  at.y = hn::Mul(hn::NegMulAdd(hn::Set(d, run.slope_up), ahead, hn::Set(d, offset.up)), scale);
  V r, g, b, seen;
  hn::LoadInterleaved4(d, run.samples[c] + 4 * i, r, g, b, seen);
  const auto counts =
      hn::And(hn::Gt(distance, hn::Set(d, kMinAngularDistance)), hn::Gt(seen, zero));
  const auto per_seen = hn::Div(hn::Set(d, 255.0F), hn::Max(seen, tiny));
  at.r = hn::IfThenElseZero(counts, hn::Mul(r, per_seen));
  at.g = hn::IfThenElseZero(counts, hn::Mul(g, per_seen));
  at.b = hn::IfThenElseZero(counts, hn::Mul(b, per_seen));
  at.seen = hn::IfThenElseZero(
      counts, hn::Mul(hn::LoadU(d, run.visible[c] + i), hn::Mul(seen, hn::Set(d, 1 / 65535.0F))));
  at.weight = hn::Mul(at.seen, hn::LoadU(d, run.weights[c] + i));
  return at;
}

void fit(const AngularRun& run, AngularFitResult& result) {
  const hn::ScalableTag<float> d;
  using V = hn::Vec<decltype(d)>;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const int count = static_cast<int>(run.inverse_depth.size());
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0F), tiny = hn::Set(d, 1e-30F);
  const auto third = hn::Set(d, 1.0F / 3);
  HWY_ALIGN float depths[kMaxRunPixels] = {};
  std::copy(run.inverse_depth.begin(), run.inverse_depth.end(), depths);
  for (int i = 0; i < count; i += lanes) {
    const auto depth = hn::Load(d, depths + i);
    const auto slope = hn::MulAdd(hn::Iota(d, static_cast<float>(i)), hn::Set(d, run.slope_step),
                                  hn::Set(d, run.slope));
    V weights = zero, seen = zero, r = zero, g = zero, b = zero;
    for (std::size_t c = 0; c < run.samples.size(); ++c) {
      const auto at = angular_camera(d, run, c, i, slope, depth);
      weights = hn::Add(weights, at.weight);
      seen = hn::Add(seen, at.seen);
      r = hn::MulAdd(at.weight, at.r, r);
      g = hn::MulAdd(at.weight, at.g, g);
      b = hn::MulAdd(at.weight, at.b, b);
    }
    const auto per_weight = hn::Div(one, hn::Max(weights, tiny));
    r = hn::Mul(r, per_weight);
    g = hn::Mul(g, per_weight);
    b = hn::Mul(b, per_weight);
    AngularEquations<decltype(d)> equations(d);
    V squares = zero;
    for (std::size_t c = 0; c < run.samples.size(); ++c) {
      const auto at = angular_camera(d, run, c, i, slope, depth);
      const auto off_r = hn::Sub(at.r, r), off_g = hn::Sub(at.g, g), off_b = hn::Sub(at.b, b);
      const auto square = hn::MulAdd(off_r, off_r, hn::MulAdd(off_g, off_g, hn::Mul(off_b, off_b)));
      squares = hn::MulAdd(at.weight, square, squares);
      equations.add(at.weight, at.x, at.y, off_r, off_g, off_b);
    }
    const auto explained = equations.eliminate(hn::Mul(hn::Set(d, kAngularRidge), weights));
    const auto inverse = hn::Div(one, hn::Max(equations.pivot(kLast), tiny));
    const auto dr = hn::Mul(equations.right(kLast, 0), inverse);
    const auto dg = hn::Mul(equations.right(kLast, 1), inverse);
    const auto db = hn::Mul(equations.right(kLast, 2), inverse);
    const auto difference = hn::Mul(third, hn::MulAdd(dr, dr, hn::MulAdd(dg, dg, hn::Mul(db, db))));
    const auto freedom = hn::Sub(seen, hn::Set(d, static_cast<float>(kAngularTerms)));
    const auto residual = hn::Mul(third, hn::Max(zero, hn::Sub(squares, explained)));
    const auto noise = hn::Mul(hn::Div(residual, hn::Max(freedom, tiny)),
                               hn::Max(zero, hn::Sub(inverse, per_weight)));
    const auto is_valid = hn::And(hn::And(hn::Gt(weights, hn::Set(d, kMinAngularWeight)),
                                          hn::Ge(seen, hn::Set(d, kMinAngularCameras))),
                                  hn::Le(hn::Mul(inverse, weights), hn::Set(d, kMaxAngularGain)));
    const auto to_codes = hn::Set(d, 65535.0F / 255);
    const auto colour = [&](V mean, V off) HWY_ATTR {
      return hn::IfThenElseZero(is_valid, hn::Mul(hn::Add(mean, off), to_codes));
    };
    hn::StoreInterleaved4(colour(r, dr), colour(g, dg), colour(b, db),
                          hn::IfThenElseZero(is_valid, one), d, result.rgba.data() + 4 * i);
    hn::StoreU(hn::IfThenElseZero(is_valid, difference), d, result.difference.data() + i);
    hn::StoreU(hn::IfThenElseZero(is_valid, noise), d, result.noise.data() + i);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::render {

HWY_EXPORT(fit);

void fit_angular(const AngularRun& run, AngularFitResult& result) {
  HWY_DYNAMIC_DISPATCH(fit)(run, result);
}

}  // namespace raystage::render
#endif
