// SPDX-License-Identifier: Apache-2.0
// Where cameras see a block of pixels, plane by plane, in vectors. Included once per instruction
// set, as Highway's kernels are: no include guard of the common kind.

#if defined(RAYSTAGE_RENDER_SWEEP_BLOCK_POSITIONS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYSTAGE_RENDER_SWEEP_BLOCK_POSITIONS_INL_H
#undef RAYSTAGE_RENDER_SWEEP_BLOCK_POSITIONS_INL_H
#else
#define RAYSTAGE_RENDER_SWEEP_BLOCK_POSITIONS_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cmath>

#include "render/sampling/lens-inl.h"
#include "render/sweep/cost_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace raystage {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// Positions in BlockPositions are multiples of these parts of a pixel; below the limit, see
// evaluate_rounded().
constexpr int kColumnBits = 8, kRowBits = 12;
constexpr float kFastRoundLimit = 1 << 22;
constexpr float kPositionUnit = 1.0F / (1 << kColumnBits);
// By how much a block's parabola may be off where it is checked. What is of fourth order is off by
// 4/3 of that elsewhere, and rounding adds half a part: one part in all.
constexpr float kFitTolerance = 0.375F * kPositionUnit;

/// A camera's look at a block: (X, Y, W) = first + x * along + plane * step at the x-th pixel, in
/// double; from there on in float. Positions are told from the centre of a pixel amid them, so that
/// they are small numbers; for a lens that bends they are small only behind it.
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
    if (!lens_->distorted) {  // pixels at once
      fold(first_);
      fold(along_);
      fold(step_);
    }
    choose_origin(0.5 * (count - 1), 0.5 * (run.planes.count - 1));
  }

  int column() const { return column_; }  ///< the origin, in the MatchingFrame
  int row() const { return row_; }

  template <class V, class M>
  struct ProjectedPoints {
    V u, v;  ///< from the origin's centre
    M seen;
  };
  /// At pixels x from `x` on, of one plane.
  template <class D, class V>
  HWY_INLINE auto along_row(D d, V x, int plane) const {
    return look(d, [&](std::size_t r) HWY_ATTR {
      return hn::MulAdd(x, set(d, along_[r]), set(d, first_[r] + plane * step_[r]));
    });
  }
  /// At one x, of planes from `plane` on.
  template <class D>
  HWY_INLINE auto across_planes(D d, double x, int plane) const {
    const auto planes = hn::Iota(d, static_cast<float>(plane));
    return look(d, [&](std::size_t r) HWY_ATTR {
      return hn::MulAdd(planes, set(d, step_[r]), set(d, first_[r] + x * along_[r]));
    });
  }

  /// The outermost positions between which nothing lies beyond the frame or the box.
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
    if (w > 0) {
      double u = at(0) / w, v = at(1) / w;
      if (lens_->distorted) {  // near enough
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
  HWY_INLINE auto look(D d, const Line& line) const {
    using V = hn::Vec<D>;
    const auto zero = hn::Zero(d), one = hn::Set(d, 1.0F);
    const auto w = line(2);
    const auto in_front = hn::Gt(w, zero);
    const auto inverse = hn::Div(one, hn::IfThenElse(in_front, w, one));
    const auto x = hn::Mul(line(0), inverse), y = hn::Mul(line(1), inverse);
    if (lens_->distorted) {
      const auto sight = project_through_lens(d, *lens_, x, y, in_front);
      const auto seen = hn::Gt(sight.seen, zero);
      return ProjectedPoints<V, decltype(seen)>{hn::Sub(sight.u, set(d, left_)),
                                                hn::Sub(sight.v, set(d, top_)), seen};
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
  double left_ = 0, top_ = 0;  ///< the origin's centre, in the frame
};

/// Positions along a block by a parabola through those at its first, middle and last pixel: start +
/// t (slope + t bend), t from 0 to 1.
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
/// Numbers between which all of it lies: beyond its ends it bulges by no more than it bends.
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

/// Positions at pixels of a block: c0 + x (c1 + x c2).
template <class V>
struct Curve {
  V c0, c1, c2;
};
template <class V>
HWY_INLINE V along(const Curve<V>& curve, V x) {
  return hn::MulAdd(hn::MulAdd(curve.c2, x, curve.c1), x, curve.c0);
}
/// Rounded to the nearest whole number, below kFastRoundLimit: by one addition that pushes what is
/// behind the point out of the mantissa.
template <class V>
HWY_INLINE auto evaluate_rounded(const Curve<V>& curve, V x) {
  const hn::DFromV<V> d;
  const hn::RebindToSigned<decltype(d)> di;
  const auto push = hn::Set(d, 3 * kFastRoundLimit);
  return hn::Sub(hn::BitCast(di, hn::Add(along(curve, x), push)), hn::BitCast(di, push));
}

/// Fits parabolas to a block's exact positions: a perspective view, and a lens, are that smooth
/// over a few pixels. Not where a fourth exact one, amid the first half, says otherwise, nor where
/// some are beyond the frame. Returns whether it is so at every plane.
class PositionFit {
 public:
  PositionFit(const BlockProjection& sight, int count) : sight_(sight), end_(count - 1) {
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
    const auto first = sight_.across_planes(d, 0, plane);
    const auto middle = sight_.across_planes(d, end_ / 2, plane);
    const auto last = sight_.across_planes(d, end_, plane);
    const auto check = sight_.across_planes(d, end_ / 4, plane);
    const auto u = fit_parabola(first.u, middle.u, last.u);
    const auto v = fit_parabola(first.v, middle.v, last.v);

    const auto part = hn::Set(d, kPositionUnit), tolerance = hn::Set(d, kFitTolerance);
    const auto extent_u = parabola_bounds(u, part), extent_v = parabola_bounds(v, part);
    auto even = hn::And(hn::And(first.seen, middle.seen), hn::And(last.seen, check.seen));
    const auto holds = [&](const auto& curve, auto truth, const auto& extent, float least,
                           float most, int bits) HWY_ATTR {
      const float limit = kFastRoundLimit / static_cast<float>(1 << bits);
      const auto t = hn::Set(d, 0.25F);
      const auto guess = hn::MulAdd(t, hn::MulAdd(t, curve.bend, curve.slope), curve.start);
      const auto within = hn::And(hn::Ge(extent.low, hn::Set(d, std::max(least, -limit))),
                                  hn::Le(extent.high, hn::Set(d, std::min(most, limit))));
      return hn::And(within, hn::Le(hn::Abs(hn::Sub(guess, truth)), tolerance));
    };
    even = hn::And(even, holds(u, check.u, extent_u, sight_.min_u(), sight_.max_u(), kColumnBits));
    even = hn::And(even, holds(v, check.v, extent_v, sight_.min_v(), sight_.max_v(), kRowBits));

    const Curve<V> u_units = scaled(d, u, 1 << kColumnBits), v_units = scaled(d, v, 1 << kRowBits);
    hn::StoreU(u_units.c0, d, out.u[0] + plane);
    hn::StoreU(u_units.c1, d, out.u[1] + plane);
    hn::StoreU(u_units.c2, d, out.u[2] + plane);
    hn::StoreU(v_units.c1, d, out.v[1] + plane);
    hn::StoreU(v_units.c2, d, out.v[2] + plane);
    store_parts(d, plane, u_units, v_units, hn::Add(hn::Abs(v.bend), part), out);
    const auto yes = hn::RebindMask(di, even);
    hn::StoreU(hn::IfThenElseZero(yes, hn::Set(di, 1)), di, out.even + plane);
    const auto beyond =
        hn::Ge(hn::Iota(d, static_cast<float>(plane)), hn::Set(d, static_cast<float>(planes)));
    return hn::AllTrue(d, hn::Or(even, beyond));
  }

  /// By pixels of the block, and in parts of a pixel.
  template <class D, class V>
  HWY_INLINE Curve<V> scaled(D d, const Parabola<V>& curve, int unit) const {
    const auto scale = static_cast<float>(unit);
    return {hn::Mul(curve.start, hn::Set(d, scale)),
            hn::Mul(curve.slope, hn::Set(d, scale * per_pixel_)),
            hn::Mul(curve.bend, hn::Set(d, scale * per_pixel_ * per_pixel_))};
  }

  /// Which columns and rows the parts need. `margin`: rows that v may be off.
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

  const BlockProjection& sight_;
  double end_;
  float per_pixel_ = 0;
};

// NOLINTNEXTLINE(google-readability-namespace-comments)
}  // namespace HWY_NAMESPACE
}  // namespace raystage
HWY_AFTER_NAMESPACE();

#endif  // per target
