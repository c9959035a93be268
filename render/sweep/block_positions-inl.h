// SPDX-License-Identifier: Apache-2.0
// Computes positions of a block of pixels in a camera, plane by plane, in vectors: exact
// projections, and parabolas fitted to them (1/256 and 1/4096 pixel). Cost: O(planes) per block and
// camera for the fit. Included once per instruction set by Highway, so its include guard toggles.
// Tested against 50 decimal digits in positions_extremes_test.cpp.

#if defined(RAYSTAGE_RENDER_SWEEP_BLOCK_POSITIONS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYSTAGE_RENDER_SWEEP_BLOCK_POSITIONS_INL_H
#undef RAYSTAGE_RENDER_SWEEP_BLOCK_POSITIONS_INL_H
#else
#define RAYSTAGE_RENDER_SWEEP_BLOCK_POSITIONS_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cmath>

#include "render/sampling/fisheye_footprint.h"
#include "render/sampling/lens-inl.h"
#include "render/sweep/cost_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// Units of BlockPositions are 2^-bits pixels. The limit: see evaluate_rounded().
constexpr int kColumnBits = 8, kRowBits = 12;
constexpr float kFastRoundLimit = 1 << 22;
constexpr float kPositionUnit = 1.0F / (1 << kColumnBits);
// Largest error of a block's parabola at the checked pixel. Errors of fourth order are up to 4/3 of
// that elsewhere, and rounding adds half a unit: one unit in total.
constexpr float kFitTolerance = 0.375F * kPositionUnit;

/// A camera's projection of a block: (X, Y, W) = first + x * along + plane * step at the x-th
/// pixel, in double; then in float. Positions are relative to the centre of a pixel in their
/// middle, so that they are small numbers. With lens distortion they are relative only after the
/// lens.
class BlockProjection {
 public:
  BlockProjection() = default;
  BlockProjection(const MatchingCamera& camera, const CostRun& run, int begin, int count)
      : lens_(&camera.source.camera), box_(camera.frame->box()) {
    const double* m = lens_->ideal_from_pixel.data();
    const auto& deep = camera.source.per_inverse_depth;
    for (std::size_t r = 0; r < 3; ++r) {
      first_[r] = m[3 * r] * (begin + 0.5) + m[3 * r + 1] * (run.y + 0.5) + m[3 * r + 2] +
                  run.planes.farthest * deep[r];
      along_[r] = m[3 * r];
      step_[r] = run.planes.step * deep[r];
    }
    if (!lens_->distorted) {  // project to pixels directly
      fold(first_);
      fold(along_);
      fold(step_);
    }
    choose_origin(0.5 * (count - 1), 0.5 * (run.planes.count - 1));
  }

  int column() const { return column_; }  ///< of the origin in the MatchingFrame
  int row() const { return row_; }

  template <class V, class M>
  struct ProjectedPoints {
    V u, v;  ///< relative to the origin's centre, pixels
    M seen;
  };
  /// Returns the positions of the pixels `x` of the block on one plane.
  template <class D, class V>
  HWY_INLINE auto along_row(D d, V x, int plane) const {
    return project(d, [&](std::size_t r) HWY_ATTR {
      return hn::MulAdd(x, set(d, along_[r]), set(d, first_[r] + plane * step_[r]));
    });
  }
  /// Returns the positions of pixel `x` on planes `plane`, `plane` + 1, ...
  template <class D>
  HWY_INLINE auto across_planes(D d, double x, int plane) const {
    const auto planes = hn::Iota(d, static_cast<float>(plane));
    return project(d, [&](std::size_t r) HWY_ATTR {
      return hn::MulAdd(planes, set(d, step_[r]), set(d, first_[r] + x * along_[r]));
    });
  }

  /// Bounds within which positions are inside both the frame and the box.
  float min_u() const { return static_cast<float>(-column_); }
  float min_v() const { return static_cast<float>(-row_); }
  float max_u() const { return static_cast<float>(box_.right - 1 - box_.left - column_); }
  float max_v() const { return static_cast<float>(box_.bottom - 1 - box_.top - row_); }

 private:
  template <class D>
  static HWY_INLINE auto set(D d, double value) {
    return hn::Set(d, static_cast<float>(value));
  }

  void fold(std::array<double, 3>& line) const {
    line[0] = static_cast<double>(lens_->fx) * line[0] + static_cast<double>(lens_->cx) * line[2];
    line[1] = static_cast<double>(lens_->fy) * line[1] + static_cast<double>(lens_->cy) * line[2];
  }

  void choose_origin(double x, double plane) {
    const auto at = [&](std::size_t r) { return first_[r] + x * along_[r] + plane * step_[r]; };
    const double w = at(2);
    if (lens_->is_fisheye) {
      const Eigen::Vector2d pixel = fisheye_position(*lens_, {at(0), at(1), w});
      column_ = within(pixel.x() - box_.left, box_.right - box_.left);
      row_ = within(pixel.y() - box_.top, box_.bottom - box_.top);
    } else if (w > 0) {
      double u = at(0) / w, v = at(1) / w;
      if (lens_->distorted) {  // without distortion: close enough for an origin
        u = static_cast<double>(lens_->fx) * u + static_cast<double>(lens_->cx);
        v = static_cast<double>(lens_->fy) * v + static_cast<double>(lens_->cy);
      }
      column_ = within(u - box_.left, box_.right - box_.left);
      row_ = within(v - box_.top, box_.bottom - box_.top);
    }
    left_ = box_.left + column_ + 0.5;
    top_ = box_.top + row_ + 0.5;
    if (lens_->distorted) return;
    for (std::array<double, 3>* line : {&first_, &along_, &step_}) {
      (*line)[0] -= left_ * (*line)[2];
      (*line)[1] -= top_ * (*line)[2];
    }
  }
  static int within(double at, int size) {
    return static_cast<int>(std::clamp(at, 0.0, size - 1.0));
  }

  template <class D, class Line>
  HWY_INLINE auto project(D d, const Line& line) const {
    using V = hn::Vec<D>;
    const auto zero = hn::Zero(d), one = hn::Set(d, 1.0F);
    const auto w = line(2);
    const auto in_front = hn::Gt(w, zero);
    const auto inverse = hn::Div(one, hn::IfThenElse(in_front, w, one));
    const auto x = hn::Mul(line(0), inverse), y = hn::Mul(line(1), inverse);
    if (lens_->distorted) {
      const auto point = lens_->is_fisheye ? project_through_fisheye(d, *lens_, line(0), line(1), w)
                                           : project_through_lens(d, *lens_, x, y, in_front);
      const auto seen = hn::Gt(point.seen, zero);
      return ProjectedPoints<V, decltype(seen)>{hn::Sub(point.u, set(d, left_)),
                                                hn::Sub(point.v, set(d, top_)), seen};
    }
    const auto inside_u =
        hn::And(hn::Gt(x, set(d, -left_)), hn::Lt(x, set(d, lens_->width - left_)));
    const auto inside_v =
        hn::And(hn::Gt(y, set(d, -top_)), hn::Lt(y, set(d, lens_->height - top_)));
    const auto seen = hn::And(in_front, hn::And(inside_u, inside_v));
    return ProjectedPoints<V, decltype(seen)>{x, y, seen};
  }

  const SourceView* lens_ = nullptr;
  FrameBox box_;
  std::array<double, 3> first_{}, along_{}, step_{};
  int column_ = 0, row_ = 0;
  double left_ = 0, top_ = 0;  ///< centre of the origin in the frame
};

/// A parabola through the positions of the first, middle and last pixel of a block:
///   start + t (slope + t bend), t from 0 to 1.
template <class V>
struct Parabola {
  V start, slope, bend;
};
template <class V>
HWY_INLINE Parabola<V> fit_parabola(V first, V middle, V last) {
  const auto twice = hn::Sub(hn::Add(first, last), hn::Add(middle, middle));
  const auto bend = hn::Add(twice, twice);
  return {first, hn::Sub(hn::Sub(last, first), bend), bend};
}
/// Bounds of a parabola: it exceeds its ends by at most its bend.
template <class V>
struct Extent {
  V low, high;
};
template <class V>
HWY_INLINE Extent<V> parabola_bounds(const Parabola<V>& curve, V margin) {
  const auto end = hn::Add(curve.start, hn::Add(curve.slope, curve.bend));
  const auto more = hn::Add(hn::Abs(curve.bend), margin);
  return {hn::Sub(hn::Min(curve.start, end), more), hn::Add(hn::Max(curve.start, end), more)};
}

/// Positions as a function of the pixel x of a block: c0 + x (c1 + x c2).
template <class V>
struct Curve {
  V c0, c1, c2;
};
template <class V>
HWY_INLINE V along(const Curve<V>& curve, V x) {
  return hn::MulAdd(hn::MulAdd(curve.c2, x, curve.c1), x, curve.c0);
}
/// Returns positions rounded to integers, for values below kFastRoundLimit: one addition shifts the
/// fraction out of the mantissa.
template <class V>
HWY_INLINE auto evaluate_rounded(const Curve<V>& curve, V x) {
  const hn::DFromV<V> d;
  const hn::RebindToSigned<decltype(d)> di;
  const auto push = hn::Set(d, 3 * kFastRoundLimit);
  return hn::Sub(hn::BitCast(di, hn::Add(along(curve, x), push)), hn::BitCast(di, push));
}

/// Fits parabolas to a block's exact positions: perspective and lenses are smooth over a few
/// pixels. A fit is rejected if a fourth exact position, in the first half, differs by more than
/// kFitTolerance, or if positions may be outside the frame. fit() returns whether all planes fit.
class PositionFit {
 public:
  PositionFit(const BlockProjection& projection, int count)
      : projection_(projection), end_(count - 1) {
    if (count > 1) per_pixel_ = 1 / static_cast<float>(end_);
  }

  HWY_INLINE bool fit(int planes, const BlockPositions& out) const {
    const hn::ScalableTag<float> d;
    bool all = true;
    for (int plane = 0; plane < planes; plane += static_cast<int>(hn::Lanes(d))) {
      all &= fit_planes(d, plane, planes, out);
    }
    return all;
  }

 private:
  template <class D>
  HWY_INLINE bool fit_planes(D d, int plane, int planes, const BlockPositions& out) const {
    using V = hn::Vec<D>;
    const hn::RebindToSigned<D> di;
    const auto first = projection_.across_planes(d, 0, plane);
    const auto middle = projection_.across_planes(d, end_ / 2, plane);
    const auto last = projection_.across_planes(d, end_, plane);
    const auto check = projection_.across_planes(d, end_ / 4, plane);
    const auto u = fit_parabola(first.u, middle.u, last.u);
    const auto v = fit_parabola(first.v, middle.v, last.v);

    const auto part = hn::Set(d, kPositionUnit), tolerance = hn::Set(d, kFitTolerance);
    const auto extent_u = parabola_bounds(u, part), extent_v = parabola_bounds(v, part);
    auto fitted = hn::And(hn::And(first.seen, middle.seen), hn::And(last.seen, check.seen));
    const auto holds = [&](const auto& curve, auto truth, const auto& extent, float least,
                           float most, int bits) HWY_ATTR {
      const float limit = kFastRoundLimit / static_cast<float>(1 << bits);
      const auto t = hn::Set(d, 0.25F);
      const auto guess = hn::MulAdd(t, hn::MulAdd(t, curve.bend, curve.slope), curve.start);
      const auto within = hn::And(hn::Ge(extent.low, hn::Set(d, std::max(least, -limit))),
                                  hn::Le(extent.high, hn::Set(d, std::min(most, limit))));
      return hn::And(within, hn::Le(hn::Abs(hn::Sub(guess, truth)), tolerance));
    };
    fitted = hn::And(
        fitted, holds(u, check.u, extent_u, projection_.min_u(), projection_.max_u(), kColumnBits));
    fitted = hn::And(
        fitted, holds(v, check.v, extent_v, projection_.min_v(), projection_.max_v(), kRowBits));

    const Curve<V> u_units = scaled(d, u, 1 << kColumnBits), v_units = scaled(d, v, 1 << kRowBits);
    hn::StoreU(u_units.c0, d, out.u[0] + plane);
    hn::StoreU(u_units.c1, d, out.u[1] + plane);
    hn::StoreU(u_units.c2, d, out.u[2] + plane);
    hn::StoreU(v_units.c1, d, out.v[1] + plane);
    hn::StoreU(v_units.c2, d, out.v[2] + plane);
    store_parts(d, plane, u_units, v_units, hn::Add(hn::Abs(v.bend), part), out);
    const auto yes = hn::RebindMask(di, fitted);
    hn::StoreU(hn::IfThenElseZero(yes, hn::Set(di, 1)), di, out.fitted + plane);
    const auto beyond =
        hn::Ge(hn::Iota(d, static_cast<float>(plane)), hn::Set(d, static_cast<float>(planes)));
    return hn::AllTrue(d, hn::Or(fitted, beyond));
  }

  /// Converts a parabola to pixels of the block and units of 1 / `unit` pixel.
  template <class D, class V>
  HWY_INLINE Curve<V> scaled(D d, const Parabola<V>& curve, int unit) const {
    const auto scale = static_cast<float>(unit);
    return {hn::Mul(curve.start, hn::Set(d, scale)),
            hn::Mul(curve.slope, hn::Set(d, scale * per_pixel_)),
            hn::Mul(curve.bend, hn::Set(d, scale * per_pixel_ * per_pixel_))};
  }

  /// Stores the first column and row that each part reads. `margin`: the error of v in rows.
  template <class D, class V>
  HWY_INLINE void store_parts(D d, int plane, const Curve<V>& u, const Curve<V>& v, V margin,
                              const BlockPositions& out) const {
    const hn::RebindToSigned<D> di;
    const auto unit = hn::Set(d, static_cast<float>(1 << kRowBits)),
               per_unit = hn::Set(d, 1.0F / (1 << kRowBits));
    const int lanes = static_cast<int>(hn::Lanes(d)), end = static_cast<int>(end_);
    for (int part = 0; part * lanes < kCostBlockSize; ++part) {
      const auto from = hn::Set(d, static_cast<float>(std::min(part * lanes, end)));
      const auto to = hn::Set(d, static_cast<float>(std::min(part * lanes + lanes - 1, end)));
      const auto column = hn::Min(evaluate_rounded(u, from), evaluate_rounded(u, to));
      const auto first = hn::Mul(along(v, from), per_unit), last = hn::Mul(along(v, to), per_unit);
      const auto row = hn::Floor(hn::Sub(hn::Min(first, last), margin));
      const auto more = hn::Sub(hn::Floor(hn::Add(hn::Max(first, last), margin)), row);
      const auto coded = hn::MulAdd(row, hn::Set(d, 4.0F), hn::Min(more, hn::Set(d, 2.0F)));
      const std::ptrdiff_t at = part * out.stride + plane;
      hn::StoreU(hn::ShiftRight<kColumnBits>(column), di, out.column + at);
      hn::StoreU(hn::NearestInt(coded), di, out.row + at);
      hn::StoreU(hn::NegMulAdd(row, unit, v.c0), d, out.v[0] + at);
    }
  }

  const BlockProjection& projection_;
  double end_;
  float per_pixel_ = 0;
};

// NOLINTNEXTLINE(google-readability-namespace-comments)
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#endif  // per target
