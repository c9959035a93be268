// SPDX-License-Identifier: Apache-2.0
#include "testing/render/position_probe.h"

#include <cstddef>
#include <cstdint>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "testing/render/position_probe.cpp"
// The order matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
#include "render/sweep/block_positions-inl.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage::testing {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using render::HWY_NAMESPACE::BlockProjection, render::HWY_NAMESPACE::PositionFit;
using render::HWY_NAMESPACE::Curve, render::HWY_NAMESPACE::evaluate_rounded;
using render::HWY_NAMESPACE::kColumnBits, render::HWY_NAMESPACE::kRowBits;

/// Computes positions as sample_fitted() and sample_exactly() of the cost kernels do.
void probe(const render::MatchingCamera& camera, const render::CostRun& run, int begin, int count,
           std::vector<ProbedPosition>& found) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  render::CostScratch scratch(run.planes.count, 1);
  const render::BlockPositions positions = scratch.positions(0);
  const BlockProjection projection(camera, run, begin, count);
  PositionFit(projection, count).fit(run.planes.count, positions);
  const double left = camera.frame->box().left + projection.column() + 0.5;
  const double top = camera.frame->box().top + projection.row() + 0.5;
  for (int plane = 0; plane < run.planes.count; ++plane) {
    for (int x = 0; x < count; ++x) {
      const auto at = hn::Set(d, static_cast<float>(x));
      ProbedPosition position;
      position.by_fit = positions.fitted[plane] != 0;
      if (position.by_fit) {
        const auto nearest = [&](const float* c0, const float* c1, const float* c2) HWY_ATTR {
          using V = hn::Vec<decltype(d)>;
          const Curve<V> curve{hn::Set(d, *c0), hn::Set(d, *c1), hn::Set(d, *c2)};
          return hn::GetLane(evaluate_rounded(curve, at));
        };
        const std::ptrdiff_t part = x / lanes * positions.stride + plane;
        const std::int32_t u =
            nearest(positions.u[0] + plane, positions.u[1] + plane, positions.u[2] + plane);
        const std::int32_t v =
            nearest(positions.v[0] + part, positions.v[1] + plane, positions.v[2] + plane);
        position.u = left + static_cast<double>(u) / (1 << kColumnBits);
        position.v = top + (positions.row[part] >> 2) + static_cast<double>(v) / (1 << kRowBits);
        position.seen = true;
      } else {
        const auto place = projection.along_row(d, at, plane);
        position.seen = hn::AllTrue(d, place.seen);
        const auto rounded = [&](auto value, int bits) HWY_ATTR {
          const auto unit = hn::Set(d, static_cast<float>(1 << bits));
          return static_cast<double>(hn::GetLane(hn::NearestInt(hn::Mul(value, unit)))) /
                 (1 << bits);
        };
        position.u = left + rounded(hn::IfThenElseZero(place.seen, place.u), kColumnBits);
        position.v = top + rounded(hn::IfThenElseZero(place.seen, place.v), kRowBits);
      }
      found.push_back(position);
    }
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage::testing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::testing {

HWY_EXPORT(probe);

std::vector<ProbedPosition> probe_positions(const render::MatchingCamera& camera,
                                            const render::CostRun& run, int begin, int count) {
  std::vector<ProbedPosition> found;
  HWY_DYNAMIC_DISPATCH(probe)(camera, run, begin, count, found);
  return found;
}

}  // namespace raystage::testing
#endif
