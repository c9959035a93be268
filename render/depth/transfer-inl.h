// SPDX-License-Identifier: Apache-2.0
// Computes PixelTransfer along a row of pixels, in vectors. Input: inverse depths (1/m). Output:
// pixel positions and inverse depths in the other camera. Cost: constant per pixel. Included once
// per instruction set by Highway, so its include guard toggles. Tested against 50 decimal digits in
// transfer_extremes_test.cpp.

#if defined(RAYSTAGE_RENDER_DEPTH_TRANSFER_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYSTAGE_RENDER_DEPTH_TRANSFER_INL_H
#undef RAYSTAGE_RENDER_DEPTH_TRANSFER_INL_H
#else
#define RAYSTAGE_RENDER_DEPTH_TRANSFER_INL_H
#endif

#include <hwy/highway.h>

#include <array>

#include "render/depth/inverse_depth_map.h"

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {

/// A transfer of the pixels of row y into an image of width x height pixels.
class RowTransfer {
 public:
  RowTransfer() = default;
  RowTransfer(const PixelTransfer& transfer, int y, int width, int height)
      : width_(static_cast<float>(width)), height_(static_cast<float>(height)) {
    for (std::size_t r = 0; r < 3; ++r) {
      const double* m = transfer.direction.data() + 3 * r;
      base_[r] = 0.5 * m[0] + (m[1] * (y + 0.5) + m[2]);
      step_[r] = m[0];
      parallax_[r] = static_cast<float>(transfer.parallax[r]);
    }
  }

  template <class V, class M>
  struct TransferredPoint {
    V u, v, inverse_depth;
    V per_w;   ///< 1 / W if W > 0
    M inside;  ///< in front, within [0, width] x [0, height]; u = v = 0 elsewhere
  };
  /// Returns the transferred points of pixels x, x + 1, ... at inverse depths q, 1/m.
  template <class D, class V>
  HWY_INLINE auto at(D d, int x, V q) const {
    return at(d, x, hwy::HWY_NAMESPACE::Iota(d, 0), q);
  }
  /// Returns the transferred points of the pixels `right` of x. Their error grows with the
  /// distance: 1e-3 pixels for a row of 8000.
  template <class D, class V>
  HWY_INLINE auto at(D d, int x, V right, V q) const {
    namespace hn = hwy::HWY_NAMESPACE;
    // The base is exact in double; the offsets from it are small enough for float.
    const auto part = [&](std::size_t r) HWY_ATTR {
      const auto base = hn::Set(d, static_cast<float>(base_[r] + step_[r] * x));
      const auto along = hn::MulAdd(right, hn::Set(d, static_cast<float>(step_[r])), base);
      return hn::MulAdd(q, hn::Set(d, parallax_[r]), along);
    };
    const auto zero = hn::Zero(d), one = hn::Set(d, 1.0F), w = part(2);
    const auto in_front = hn::Gt(w, zero);
    const auto inverse = hn::Div(one, hn::IfThenElse(in_front, w, one));
    auto u = hn::Mul(part(0), inverse), v = hn::Mul(part(1), inverse);
    const auto inside =
        hn::And(hn::And(in_front, hn::And(hn::Ge(u, zero), hn::Le(u, hn::Set(d, width_)))),
                hn::And(hn::Ge(v, zero), hn::Le(v, hn::Set(d, height_))));
    u = hn::IfThenElseZero(inside, u);
    v = hn::IfThenElseZero(inside, v);
    return TransferredPoint<V, decltype(inside)>{u, v, hn::Mul(q, inverse), inverse, inside};
  }

 private:
  std::array<double, 3> base_{}, step_{};
  std::array<float, 3> parallax_{};
  float width_ = 0, height_ = 0;
};

// NOLINTNEXTLINE(google-readability-namespace-comments)
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#endif  // per target
