// SPDX-License-Identifier: Apache-2.0
// Kernels of foreground_fattening.cpp. find_background() looks along eight directions from a vector
// of pixels at once: O(pixels x reach). compute_agreement() compares points with the neighbours:
// O(points x neighbours). Inverse depths in 1/m, luma in codes of 255. Reference:
// camera_depths_reference.cpp.
#include "render/depth/fattening_kernels.h"

#include <algorithm>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/depth/fattening_kernels.cpp"
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
using FloatTag = hn::ScalableTag<float>;
using FloatVec = hn::Vec<FloatTag>;

/// Returns where two colours differ by less than `limit`: in luma, and in chroma in sum.
template <class DI, class V>
HWY_INLINE hn::Mask<DI> is_same_colour(DI di, V first, V second, V limit) {
  const auto byte = hn::Set(di, 0xFF);
  const auto apart = [&](V a, V b)
                         HWY_ATTR { return hn::Abs(hn::Sub(hn::And(a, byte), hn::And(b, byte))); };
  const auto luma = apart(first, second);
  const auto chroma = hn::Add(apart(hn::ShiftRight<8>(first), hn::ShiftRight<8>(second)),
                              apart(hn::ShiftRight<16>(first), hn::ShiftRight<16>(second)));
  return hn::And(hn::Lt(luma, limit), hn::Lt(chroma, limit));
}

/// Writes the background of `lanes` pixels from x on along one direction.
void find_along(const BackgroundRow& row, std::size_t direction, int x, float* depth,
                float* distance) {
  const FloatTag d;
  const hn::RebindToSigned<FloatTag> di;
  const auto [dx, dy] = kBackgroundDirections[direction];
  const BackgroundPlanes& planes = *row.planes;
  const auto zero = hn::Zero(d);
  const auto far = hn::Sub(hn::LoadU(d, planes.depths(row.y) + x), hn::Set(d, row.apart));
  const auto own = hn::LoadU(di, planes.colours(row.y) + x);
  const auto limit = hn::Set(di, row.same_colour + 1);
  auto found = hn::Set(d, kUnknownDepth), at = zero;
  auto searched = hn::Gt(hn::LoadU(d, row.is_active + x), zero);
  for (int i = 1; i <= row.reach; ++i) {
    const int y = row.y + i * dy;
    if (y < 0 || y >= planes.height()) break;
    const auto there = hn::LoadU(d, planes.depths(y) + x + i * dx);
    const auto is_behind = hn::And(searched, hn::And(hn::Ge(there, zero), hn::Le(there, far)));
    if (hn::AllFalse(d, is_behind)) continue;
    const auto colour = hn::LoadU(di, planes.colours(y) + x + i * dx);
    const auto is_known = hn::Ne(hn::And(colour, hn::Set(di, 0xFF)), hn::Zero(di));
    const auto hits = hn::And(
        is_behind, hn::RebindMask(d, hn::And(is_known, is_same_colour(di, own, colour, limit))));
    found = hn::IfThenElse(hits, there, found);
    at = hn::IfThenElse(hits, hn::Set(d, static_cast<float>(i)), at);
    searched = hn::AndNot(hits, searched);
    if (hn::AllFalse(d, searched)) break;
  }
  hn::StoreU(found, d, depth);
  hn::StoreU(at, d, distance);
}

void background(const BackgroundRow& row) {
  const FloatTag d;
  const int lanes = static_cast<int>(hn::Lanes(d)), width = row.planes->width();
  for (int x = 0; x < width; x += lanes) {
    if (hn::AllFalse(d, hn::Gt(hn::LoadU(d, row.is_active + x), hn::Zero(d)))) continue;
    for (std::size_t k = 0; k < kBackgroundDirections.size(); ++k) {
      find_along(row, k, x, row.depth[k] + x, row.distance[k] + x);
    }
  }
}

void agreement(const AgreementRow& row) {
  const FloatTag d;
  const hn::RebindToSigned<FloatTag> di;
  const int lanes = static_cast<int>(hn::Lanes(d)), count = static_cast<int>(row.columns.size());
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0F), half = hn::Set(d, 0.5F);
  const auto infinite = hn::Set(d, std::numeric_limits<float>::infinity());
  std::array<RowTransfer, kMaxNeighbours> transfers;
  for (std::size_t p = 0; p < row.neighbour_views.size(); ++p) {
    const NeighbourView& view = row.neighbour_views[p];
    transfers[p] = RowTransfer(view.transfer, row.y, view.image->width(), view.image->height());
  }
  const std::uint32_t* words =
      row.image->words() + static_cast<std::ptrdiff_t>(row.y) * row.image->width();
  HWY_ALIGN std::int32_t columns[kMostVectorLanes];
  HWY_ALIGN float depths[kMostVectorLanes], results[kMostVectorLanes];
  for (int i = 0; i < count; i += lanes) {
    const int n = std::min(lanes, count - i);
    for (int lane = 0; lane < lanes; ++lane) {
      columns[lane] = row.columns[i + std::min(lane, n - 1)];
      depths[lane] = row.inverse_depth[i + std::min(lane, n - 1)];
    }
    const auto column = hn::Load(di, columns);
    const auto q = hn::Load(d, depths);
    const auto own = hn::ConvertTo(
        d, hn::And(
               hn::GatherIndex(di, reinterpret_cast<const std::int32_t*>(words), column),  // NOLINT
               hn::Set(di, 0xFF)));
    const auto right = hn::ConvertTo(d, hn::Sub(column, hn::Set(di, columns[0])));
    FloatVec least[kMaxNeighbours / 2] = {infinite, infinite, infinite, infinite};
    auto seen_by = zero;
    for (std::size_t p = 0; p < row.neighbour_views.size(); ++p) {
      const auto place = transfers[p].at(d, columns[0], right, q);
      if (hn::AllFalse(d, place.inside)) continue;
      const auto other = luma_at(d, *row.neighbour_views[p].image, place.u, place.v);
      const auto seen = hn::And(place.inside, other.is_known);
      auto value = hn::IfThenElse(seen, hn::Abs(hn::Sub(other.code, own)), infinite);
      seen_by = hn::Add(seen_by, hn::IfThenElseZero(seen, one));
      for (FloatVec& smaller : least) {
        const auto larger = hn::Max(smaller, value);
        smaller = hn::Min(smaller, value);
        value = larger;
      }
    }
    const auto counted = hn::Floor(hn::Mul(hn::Add(seen_by, one), half));
    auto sum = zero;
    for (int k = 0; k < kMaxNeighbours / 2; ++k) {
      const auto counts = hn::Lt(hn::Set(d, static_cast<float>(k)), counted);
      sum = hn::Add(sum, hn::IfThenElseZero(counts, least[k]));
    }
    const auto mean = hn::Div(sum, hn::Max(counted, one));
    hn::Store(hn::IfThenElse(hn::Gt(seen_by, zero), mean, infinite), d, results);
    std::copy_n(results, n, row.costs + i);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::render {

HWY_EXPORT(background);
HWY_EXPORT(agreement);

BackgroundPlanes::BackgroundPlanes(const InverseDepthMap& map, const MatchingImage& image,
                                   int margin)
    : width_(map.width),
      height_(map.height),
      // Vectors begin at multiples of their length and end beyond the row.
      margin_(margin + kMostVectorLanes),
      stride_(static_cast<std::size_t>(map.width + 2 * margin_)),
      depth_(stride_ * static_cast<std::size_t>(map.height), kUnknownDepth),
      colour_(depth_.size(), 0) {
  set_depths(map);
  for (int y = 0; y < height_; ++y) {
    std::int32_t* to = colour_.data() + offset(y);
    for (int x = 0; x < width_; ++x) {
      const auto chroma = image.chroma(x, y);
      to[x] = image.luma(x, y) | (chroma[0] << 8) | (chroma[1] << 16);
    }
  }
}

void BackgroundPlanes::set_depths(const InverseDepthMap& map) {
  for (int y = 0; y < height_; ++y) {
    std::copy_n(map.values.data() + map.offset(0, y), width_, depth_.data() + offset(y));
  }
}

void find_background(const BackgroundRow& row) { HWY_DYNAMIC_DISPATCH(background)(row); }
void compute_agreement(const AgreementRow& row) { HWY_DYNAMIC_DISPATCH(agreement)(row); }

}  // namespace raystage::render
#endif
