// SPDX-License-Identifier: Apache-2.0
// Kernels of the depth estimation, a row or a run of pixels at a time. match_row() fills a row of a
// cost volume, O(pixels x planes x neighbours). refine_row() computes Geman-McClure residuals at 7
// offsets around given depths, O(pixels x 7 x support views). vote() finds the best supported
// hypothesis, O(pixels x hypotheses^2). median_row() computes a 3x3 median. Must match
// camera_depths_reference.cpp and fusion_reference.cpp.
#include "render/depth/estimation_kernels.h"

#include <algorithm>
#include <array>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/depth/estimation_kernels.cpp"
// The order matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
#include "render/depth/matching_luma-inl.h"
#include "render/depth/transfer-inl.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::ScalableTag<float>;
using V = hn::Vec<D>;
constexpr int kMaxLanes = 16;

/// Returns the camera's own luma at lanes from pixel x on; the row's last pixel is repeated.
HWY_INLINE V own_luma(D d, const MatchingImage& image, int x, int y) {
  HWY_ALIGN float codes[kMaxLanes];
  for (int i = 0; i < static_cast<int>(hn::Lanes(d)); ++i) {
    codes[i] = image.luma(std::min(x + i, image.width() - 1), y);
  }
  return hn::Load(d, codes);
}

/// Returns the mean of the smaller half of `count` values (the four smallest in `least`), or
/// `unknown` if there are none.
HWY_INLINE V mean_of_smaller_half(D d, const V* least, V count, V unknown) {
  const auto half = hn::Floor(hn::Mul(hn::Add(count, hn::Set(d, 1.0F)), hn::Set(d, 0.5F)));
  auto sum = hn::Zero(d);
  for (int i = 0; i < kMaxNeighbours / 2; ++i) {
    const auto counts = hn::Lt(hn::Set(d, static_cast<float>(i)), half);
    sum = hn::Add(sum, hn::IfThenElseZero(counts, least[i]));
  }
  const auto known = hn::Gt(count, hn::Zero(d));
  return hn::IfThenElse(known, hn::Div(sum, hn::Max(half, hn::Set(d, 1.0F))), unknown);
}

void match(const MatchRow& row) {
  const D d;
  const hn::RebindToSigned<D> di;
  const int lanes = static_cast<int>(hn::Lanes(d)), width = row.image->width();
  const auto one = hn::Set(d, 1.0F), zero = hn::Zero(d);
  const auto truncation = hn::Set(d, row.truncation);
  const auto scale = hn::Set(d, 255.0F / row.truncation);
  const auto unknown = hn::Set(d, static_cast<float>(matching::kUnknownCost));
  std::array<RowTransfer, kMaxNeighbours> transfers;
  for (std::size_t p = 0; p < row.neighbour_views.size(); ++p) {
    transfers[p] =
        RowTransfer(row.neighbour_views[p].transfer, row.y, row.neighbour_views[p].image->width(),
                    row.neighbour_views[p].image->height());
  }
  HWY_ALIGN std::int32_t bytes[kMaxLanes];
  for (int x = 0; x < width; x += lanes) {
    const auto own = own_luma(d, *row.image, x, row.y);
    const auto own_known = hn::Gt(own, zero);
    const int n = std::min(lanes, width - x);
    if (hn::AllFalse(d, own_known)) {  // nothing to compare: a fisheye's facets have many of these
      std::fill_n(row.costs + static_cast<std::ptrdiff_t>(x) * row.stride,
                  static_cast<std::ptrdiff_t>(n) * row.stride, matching::kUnknownCost);
      std::fill_n(row.seen + x, n, std::uint8_t{0});
      continue;
    }
    auto most = zero;
    for (int plane = 0; plane < row.planes; ++plane) {
      const auto q = hn::Set(d, static_cast<float>(row.farthest + plane * row.step));
      V least[kMaxNeighbours / 2] = {truncation, truncation, truncation, truncation};
      auto count = zero;
      for (std::size_t p = 0; p < row.neighbour_views.size(); ++p) {
        const auto place = transfers[p].at(d, x, q);
        if (hn::AllFalse(d, place.inside)) continue;
        const auto other = luma_at(d, *row.neighbour_views[p].image, place.u, place.v);
        const auto seen = hn::And(hn::And(place.inside, own_known), other.is_known);
        auto value = hn::Min(hn::Abs(hn::Sub(other.code, own)), truncation);
        value = hn::IfThenElse(seen, value, truncation);
        count = hn::Add(count, hn::IfThenElseZero(seen, one));
        for (V& smaller : least) {
          const auto larger = hn::Max(smaller, value);
          smaller = hn::Min(smaller, value);
          value = larger;
        }
      }
      most = hn::Max(most, count);
      // Views that do not see the point enter as the truncation: they displace no smaller value.
      const auto cost = mean_of_smaller_half(d, least, count, hn::Div(unknown, scale));
      hn::Store(hn::NearestInt(hn::Mul(cost, scale)), di, bytes);
      std::uint8_t* out = row.costs + static_cast<std::ptrdiff_t>(x) * row.stride + plane;
      for (int i = 0; i < n; ++i)
        out[static_cast<std::ptrdiff_t>(i) * row.stride] = static_cast<std::uint8_t>(bytes[i]);
    }
    hn::Store(hn::ConvertTo(di, most), di, bytes);
    for (int i = 0; i < n; ++i) row.seen[x + i] = bytes[i] > 0 ? 1 : 0;
  }
}

void refine(const RefineRow& row) {
  const D d;
  const hn::RebindToSigned<D> di;
  const int lanes = static_cast<int>(hn::Lanes(d)), width = row.image->width();
  const auto one = hn::Set(d, 1.0F), zero = hn::Zero(d);
  const auto per_truncation = hn::Set(d, 1 / (row.truncation * row.truncation));
  const auto tolerance = hn::Set(d, row.tolerance);
  std::array<RowTransfer, kMaxSupportViews> transfers;
  for (std::size_t p = 0; p < row.neighbour_views.size(); ++p) {
    transfers[p] =
        RowTransfer(row.neighbour_views[p].transfer, row.y, row.neighbour_views[p].image->width(),
                    row.neighbour_views[p].image->height());
  }
  HWY_ALIGN float present[kMaxLanes], costs[kRefineOffsets][kMaxLanes];
  for (int x = 0; x < width; x += lanes) {
    const int n = std::min(lanes, width - x);
    for (int i = 0; i < lanes; ++i) present[i] = row.inverse_depth[x + std::min(i, n - 1)];
    const auto base = hn::Load(d, present);
    const auto own = own_luma(d, *row.image, x, row.y);
    const auto own_known = hn::Gt(own, zero);
    V sums[kRefineOffsets] = {zero, zero, zero, zero, zero, zero, zero};
    auto count = zero;
    for (std::size_t p = 0; p < row.neighbour_views.size(); ++p) {
      const NeighbourView& partner = row.neighbour_views[p];
      const RowTransfer& transfer = transfers[p];
      const auto seen = transfer.at(d, x, base);
      if (hn::AllFalse(d, seen.inside)) continue;
      const InverseDepthMap& depths = *partner.depths;
      const auto in_depths = [&](V position, int first, int size) HWY_ATTR {
        const auto pixel = hn::Sub(hn::ConvertTo(di, position), hn::Set(di, first));
        return hn::Min(hn::Max(pixel, hn::Zero(di)), hn::Set(di, size - 1));
      };
      const auto column = in_depths(seen.u, partner.left, depths.width);
      const auto line = in_depths(seen.v, partner.top, depths.height);
      const auto at = hn::Add(hn::Mul(line, hn::Set(di, depths.width)), column);
      const auto limit = [&](int value) HWY_ATTR { return hn::Set(d, static_cast<float>(value)); };
      const auto has_depth = hn::And(hn::And(hn::Ge(seen.u, limit(partner.left)),
                                             hn::Le(seen.u, limit(partner.left + depths.width))),
                                     hn::And(hn::Ge(seen.v, limit(partner.top)),
                                             hn::Le(seen.v, limit(partner.top + depths.height))));
      const auto its = hn::IfThenElse(has_depth, hn::GatherIndex(d, depths.values.data(), at),
                                      hn::Set(d, kUnknownDepth));
      auto visible = hn::And(hn::And(seen.inside, own_known),
                             hn::Le(its, hn::Add(seen.inverse_depth, tolerance)));
      V tried[kRefineOffsets];
      for (int i = 0; i < kRefineOffsets; ++i) {
        const int steps = i - kRefineOffsets / 2;
        const auto step = hn::Set(d, static_cast<float>(steps * row.step));
        const auto moved = transfer.at(d, x, hn::Add(base, step));
        const auto other = luma_at(d, *partner.image, moved.u, moved.v);
        visible = hn::And(visible, hn::And(moved.inside, other.is_known));
        const auto off = hn::Sub(other.code, own);
        const auto square = hn::Mul(off, off);
        tried[i] = hn::Div(square, hn::MulAdd(square, per_truncation, one));
      }
      count = hn::Add(count, hn::IfThenElseZero(visible, one));
      for (int i = 0; i < kRefineOffsets; ++i) {
        sums[i] = hn::Add(sums[i], hn::IfThenElseZero(visible, tried[i]));
      }
    }
    const auto per_partner = hn::Div(one, hn::Max(count, one));
    for (int i = 0; i < kRefineOffsets; ++i) hn::Store(hn::Mul(sums[i], per_partner), d, costs[i]);
    for (int i = 0; i < n; ++i) {
      float* out = row.costs + static_cast<std::ptrdiff_t>(x + i) * kRefineOffsetStride;
      for (int c = 0; c < kRefineOffsets; ++c) out[c] = costs[c][i];
      out[kRefineOffsets] = 0;
    }
  }
}

void vote_run(const VoteRun& run) {
  const D d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const std::size_t count = run.hypotheses.size();
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0F), unknown = hn::Set(d, kUnknownDepth);
  const auto tiny = hn::Set(d, 1e-30F), per_tolerance = hn::Set(d, 1 / run.tolerance);
  const auto almost = hn::Set(d, 0.9999F), clearly = hn::Set(d, 1.0001F);
  V hypotheses[kMaxHypotheses], weights[kMaxHypotheses];
  for (int x = 0; x < run.count; x += lanes) {
    auto all = zero;
    for (std::size_t r = 0; r < count; ++r) {
      hypotheses[r] = hn::LoadU(d, run.hypotheses[r] + x);
      weights[r] =
          hn::IfThenElseZero(hn::Ge(hypotheses[r], zero), hn::LoadU(d, run.weights[r] + x));
      all = hn::Add(all, weights[r]);
    }
    auto best = zero, best_depth = unknown, chosen = unknown;
    for (std::size_t r = 0; r < count; ++r) {
      const auto candidate = hypotheses[r];
      auto support = zero, sum = zero;
      for (std::size_t s = 0; s < count; ++s) {
        const auto off = hn::Mul(hn::Abs(hn::Sub(hypotheses[s], candidate)), per_tolerance);
        const auto weight = hn::Mul(weights[s], hn::Max(zero, hn::Sub(one, off)));
        support = hn::Add(support, weight);
        sum = hn::MulAdd(weight, hypotheses[s], sum);
      }
      const auto better = hn::Gt(support, hn::Mul(best, clearly));
      const auto equal = hn::And(hn::Gt(support, hn::Mul(best, almost)), hn::Gt(candidate, chosen));
      const auto wins = hn::And(hn::Gt(weights[r], zero), hn::Or(better, equal));
      best_depth = hn::IfThenElse(wins, hn::Div(sum, hn::Max(support, tiny)), best_depth);
      chosen = hn::IfThenElse(wins, candidate, chosen);
      best = hn::IfThenElse(wins, support, best);
    }
    hn::StoreU(best_depth, d, run.depth + x);
    hn::StoreU(hn::Div(best, hn::Max(all, tiny)), d, run.support + x);
  }
}

/// Returns the median by a sorting network that computes only the middle (Paeth 1990).
HWY_INLINE V median_of_nine(V* v) {
  const auto sort = [&](int a, int b) HWY_ATTR {
    const V low = hn::Min(v[a], v[b]);
    v[b] = hn::Max(v[a], v[b]);
    v[a] = low;
  };
  for (const int i : {0, 3, 6}) sort(i + 1, i + 2);
  for (const int i : {0, 3, 6}) sort(i, i + 1);
  for (const int i : {0, 3, 6}) sort(i + 1, i + 2);
  sort(0, 3);
  sort(5, 8);
  sort(4, 7);
  sort(3, 6);
  sort(1, 4);
  sort(2, 5);
  sort(4, 7);
  sort(4, 2);
  sort(6, 4);
  sort(4, 2);
  return v[4];
}

/// Returns whether two opposite values of the 3 x 3 equal the middle.
HWY_INLINE hn::Mask<D> on_a_line(const V* v, V tolerance) {
  const auto like = [&](int i) HWY_ATTR { return hn::Le(hn::AbsDiff(v[i], v[4]), tolerance); };
  const auto pair = [&](int i) HWY_ATTR { return hn::And(like(i), like(8 - i)); };
  return hn::Or(hn::Or(pair(0), pair(1)), hn::Or(pair(2), pair(3)));
}

void median(const std::array<const float*, 3>& rows, float line_tolerance,
            std::span<float> medians) {
  const D d;
  const auto tolerance = hn::Set(d, line_tolerance);
  const int lanes = static_cast<int>(hn::Lanes(d)), width = static_cast<int>(medians.size());
  HWY_ALIGN float part[kMaxLanes + 2], out[kMaxLanes];
  V values[9], sorted[9];
  for (int x = 0; x < width; x += lanes) {
    const bool inner = x > 0 && x + lanes < width;
    for (std::size_t row = 0; row < 3; ++row) {
      const float* from = rows[row] + x - 1;
      if (!inner) {
        for (int i = 0; i < lanes + 2; ++i) {
          part[i] = rows[row][std::clamp(x - 1 + i, 0, width - 1)];
        }
        from = part;
      }
      for (std::size_t i = 0; i < 3; ++i) values[3 * row + i] = hn::LoadU(d, from + i);
    }
    std::copy_n(values, 9, sorted);
    V middle = median_of_nine(sorted);
    const auto nearer = hn::Gt(hn::Sub(values[4], middle), tolerance);
    if (HWY_UNLIKELY(!hn::AllFalse(d, nearer))) {
      middle = hn::IfThenElse(hn::And(nearer, on_a_line(values, tolerance)), values[4], middle);
    }
    if (inner) {
      hn::StoreU(middle, d, medians.data() + x);
    } else {
      hn::Store(middle, d, out);
      std::copy_n(out, std::min(lanes, width - x), medians.data() + x);
    }
  }
}

const char* target() { return hwy::TargetName(HWY_TARGET); }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::render {

HWY_EXPORT(match);
HWY_EXPORT(refine);
HWY_EXPORT(vote_run);
HWY_EXPORT(median);
HWY_EXPORT(target);

void match_row(const MatchRow& row) { HWY_DYNAMIC_DISPATCH(match)(row); }
void refine_row(const RefineRow& row) { HWY_DYNAMIC_DISPATCH(refine)(row); }
void vote(const VoteRun& run) { HWY_DYNAMIC_DISPATCH(vote_run)(run); }
void median_row(const std::array<const float*, 3>& rows, float line_tolerance,
                std::span<float> medians) {
  HWY_DYNAMIC_DISPATCH(median)(rows, line_tolerance, medians);
}
const char* depth_estimation_target() { return HWY_DYNAMIC_DISPATCH(target)(); }

}  // namespace raystage::render
#endif
