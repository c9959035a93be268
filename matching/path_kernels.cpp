// SPDX-License-Identifier: Apache-2.0
// Kernels of semi-global matching (Hirschmueller, "Stereo processing by semiglobal matching and
// mutual information", PAMI 2008). They advance 4 of the 8 paths by one pixel at a time,
//   L(p, d) = C(p, d) + min(L(q, d), L(q, d +- 1) + P1, min L(q) + P2) - min L(q),
// add them up and find the plane of the least sum; 16-bit lanes, one per plane. Cost: O(pixels x
// planes x paths). Must match matching_reference.cpp exactly.
#include "matching/path_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "matching/path_kernels.cpp"
// The order of these includes matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage::matching {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using Tag = hn::ScalableTag<std::uint16_t>;
using Half = hn::Rebind<std::uint8_t, Tag>;
using Vector = hn::Vec<Tag>;

/// Advances one path by one pixel for one vector of planes. `left`: the previous pixel's costs of
/// the preceding planes, which are already overwritten in `line`.
HWY_INLINE Vector step(std::uint16_t* line, Vector cost, Vector left, Vector p1, Vector least,
                       Vector jump) {
  const Tag d;
  const auto same = hn::LoadU(d, line), right = hn::LoadU(d, line + 1);
  const auto near = hn::Add(hn::Min(left, right), p1);
  return hn::Add(cost, hn::Sub(hn::Min(hn::Min(same, near), jump), least));
}

template <bool kFinish>
HWY_INLINE void run_paths(const PathRun& run, int* best) {
  const Tag d;
  const Half half;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const int whole = run.planes / lanes * lanes;
  const auto open = hn::FirstN(d, static_cast<std::size_t>(run.planes - whole));
  const auto closed = hn::Set(d, kInvalidCost);
  const auto p1 = hn::Set(d, static_cast<std::uint16_t>(run.p1));

  for (int i = 0; i < run.count; ++i) {
    const std::uint8_t* cost = run.cost + i * run.pixel_step;
    std::uint16_t* sums = run.sums + i * run.pixel_step;
    std::uint16_t* line[kPathsPerPass];
    std::uint16_t* least_at[kPathsPerPass];
    for (int p = 0; p < kPathsPerPass; ++p) {
      line[p] = run.line[p] + i * run.line_step[p];
      least_at[p] = run.least[p] + i * run.least_step[p];
    }
    const std::uint16_t* p2 = run.p2 + i * kPathsPerPass;
    const auto least0 = hn::Set(d, *least_at[0]), least1 = hn::Set(d, *least_at[1]);
    const auto least2 = hn::Set(d, *least_at[2]), least3 = hn::Set(d, *least_at[3]);
    const auto jump0 = hn::Add(least0, hn::Set(d, p2[0])),
               jump1 = hn::Add(least1, hn::Set(d, p2[1]));
    const auto jump2 = hn::Add(least2, hn::Set(d, p2[2])),
               jump3 = hn::Add(least3, hn::Set(d, p2[3]));
    auto left0 = hn::LoadU(d, line[0] - 1), left1 = hn::LoadU(d, line[1] - 1);
    auto left2 = hn::LoadU(d, line[2] - 1), left3 = hn::LoadU(d, line[3] - 1);
    auto least_next0 = closed, least_next1 = closed, least_next2 = closed, least_next3 = closed;
    auto least_sum = hn::Set(d, std::uint16_t{0xFFFF});

    const auto move_on = [&](int plane, bool is_last) HWY_ATTR {
      const auto c = hn::PromoteTo(d, hn::LoadU(half, cost + plane));
      // Overwritten below, but needed by the next planes.
      const auto next_left0 = hn::LoadU(d, line[0] + plane + lanes - 1);
      const auto next_left1 = hn::LoadU(d, line[1] + plane + lanes - 1);
      const auto next_left2 = hn::LoadU(d, line[2] + plane + lanes - 1);
      const auto next_left3 = hn::LoadU(d, line[3] + plane + lanes - 1);
      auto v0 = step(line[0] + plane, c, left0, p1, least0, jump0);
      auto v1 = step(line[1] + plane, c, left1, p1, least1, jump1);
      auto v2 = step(line[2] + plane, c, left2, p1, least2, jump2);
      auto v3 = step(line[3] + plane, c, left3, p1, least3, jump3);
      if (is_last) {
        v0 = hn::IfThenElse(open, v0, closed);
        v1 = hn::IfThenElse(open, v1, closed);
        v2 = hn::IfThenElse(open, v2, closed);
        v3 = hn::IfThenElse(open, v3, closed);
      }
      hn::StoreU(v0, d, line[0] + plane);
      hn::StoreU(v1, d, line[1] + plane);
      hn::StoreU(v2, d, line[2] + plane);
      hn::StoreU(v3, d, line[3] + plane);
      least_next0 = hn::Min(least_next0, v0);
      least_next1 = hn::Min(least_next1, v1);
      least_next2 = hn::Min(least_next2, v2);
      least_next3 = hn::Min(least_next3, v3);
      left0 = next_left0;
      left1 = next_left1;
      left2 = next_left2;
      left3 = next_left3;
      auto sum = hn::Add(hn::Add(v0, v1), hn::Add(v2, v3));
      if (kFinish) {
        sum = hn::Add(sum, hn::LoadU(d, sums + plane));
        if (is_last) sum = hn::IfThenElse(open, sum, hn::Set(d, std::uint16_t{0xFFFF}));
        least_sum = hn::Min(least_sum, sum);
      }
      hn::StoreU(sum, d, sums + plane);
    };
    for (int plane = 0; plane < whole; plane += lanes) move_on(plane, false);
    if (whole < run.planes) move_on(whole, true);

    *least_at[0] = hn::GetLane(hn::MinOfLanes(d, least_next0));
    *least_at[1] = hn::GetLane(hn::MinOfLanes(d, least_next1));
    *least_at[2] = hn::GetLane(hn::MinOfLanes(d, least_next2));
    *least_at[3] = hn::GetLane(hn::MinOfLanes(d, least_next3));
    if (kFinish) {
      const auto least = hn::MinOfLanes(d, least_sum);
      int plane = 0;
      for (;; plane += lanes) {
        const auto found = hn::FindFirstTrue(d, hn::Eq(hn::LoadU(d, sums + plane), least));
        if (found < 0) continue;
        best[i] = plane + static_cast<int>(found);
        break;
      }
    }
  }
}

void begin(const PathRun& run) { run_paths<false>(run, nullptr); }
void finish(const PathRun& run, int* best) { run_paths<true>(run, best); }

void slide_u8(std::uint16_t* sums, const std::uint8_t* add, const std::uint8_t* take,
              std::size_t count) {
  const Tag d;
  const Half half;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    const auto more = hn::PromoteTo(d, hn::LoadU(half, add + i));
    const auto less = hn::PromoteTo(d, hn::LoadU(half, take + i));
    hn::StoreU(hn::Sub(hn::Add(hn::LoadU(d, sums + i), more), less), d, sums + i);
  }
}

void slide_u16(std::uint16_t* window, const std::uint16_t* add, const std::uint16_t* take,
               std::size_t count) {
  const Tag d;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    const auto more = hn::Add(hn::LoadU(d, window + i), hn::LoadU(d, add + i));
    hn::StoreU(hn::Sub(more, hn::LoadU(d, take + i)), d, window + i);
  }
}

int least_index(const std::uint16_t* sums, int planes) {
  const Tag d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const int whole = planes / lanes * lanes;
  const auto most = hn::Set(d, std::uint16_t{0xFFFF});
  auto least = most;
  for (int plane = 0; plane < whole; plane += lanes) {
    least = hn::Min(least, hn::LoadU(d, sums + plane));
  }
  if (whole < planes) {
    const auto open = hn::FirstN(d, static_cast<std::size_t>(planes - whole));
    least = hn::Min(least, hn::IfThenElse(open, hn::LoadU(d, sums + whole), most));
  }
  least = hn::MinOfLanes(d, least);
  for (int plane = 0;; plane += lanes) {
    const auto found = hn::FindFirstTrue(d, hn::Eq(hn::LoadU(d, sums + plane), least));
    if (found >= 0) return plane + static_cast<int>(found);
  }
}

const char* target() { return hwy::TargetName(HWY_TARGET); }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage::matching
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::matching {

HWY_EXPORT(begin);
HWY_EXPORT(finish);
HWY_EXPORT(slide_u8);
HWY_EXPORT(slide_u16);
HWY_EXPORT(least_index);
HWY_EXPORT(target);

void start_path_sums(const PathRun& run) { HWY_DYNAMIC_DISPATCH(begin)(run); }
void complete_path_sums(const PathRun& run, int* best) { HWY_DYNAMIC_DISPATCH(finish)(run, best); }
void update_running_sums(std::uint16_t* sums, const std::uint8_t* add, const std::uint8_t* take,
                         std::size_t count) {
  HWY_DYNAMIC_DISPATCH(slide_u8)(sums, add, take, count);
}
void update_running_window(std::uint16_t* window, const std::uint16_t* add,
                           const std::uint16_t* take, std::size_t count) {
  HWY_DYNAMIC_DISPATCH(slide_u16)(window, add, take, count);
}
int index_of_min(const std::uint16_t* sums, int planes) {
  return HWY_DYNAMIC_DISPATCH(least_index)(sums, planes);
}
const char* matching_target() { return HWY_DYNAMIC_DISPATCH(target)(); }

}  // namespace raystage::matching
#endif
