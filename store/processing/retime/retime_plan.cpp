// SPDX-License-Identifier: Apache-2.0
// Chooses the source frames of every tick for one camera. A frame near its tick stays unchanged.
// Otherwise the tick is interpolated between the frames before and after it, if their distance is
// small enough. Input: a timeline and corrected times, ns. Output: one RetimedFrame per tick. Cost:
// O(ticks log frames).
#include "store/processing/retime/retime_plan.h"

#include <algorithm>
#include <cmath>

#include "base/options.h"

namespace raystage::store {
namespace {

constexpr double kMaxGapInTicks = 2.5;

}  // namespace

RetimePlanner::RetimePlanner(const Timeline& timeline, std::size_t camera,
                             const std::vector<Nanoseconds>& times, const RetimeOptions& options)
    : timeline_(timeline), camera_(camera), options_(options) {
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (times[i] == kExcludedTime) continue;
    if (!usable_.empty() && times[i] <= usable_.back().time) continue;
    usable_.push_back({static_cast<std::int32_t>(i), times[i]});
  }
}

void RetimePlanner::exclude(std::int32_t frame) {
  excluded_.insert(frame);
  std::erase_if(usable_, [frame](const Usable& usable) { return usable.frame == frame; });
}

RetimedFrame RetimePlanner::plan(std::size_t tick_index) const {
  const double period = static_cast<double>(kNanosecondsPerSecond) / timeline_.fps;
  const auto near_enough = static_cast<Nanoseconds>(kTickToleranceFraction * period);
  const Nanoseconds longest = options_.max_gap > 0
                                  ? options_.max_gap
                                  : static_cast<Nanoseconds>(std::llround(kMaxGapInTicks * period));
  const FrameSelection& tick = timeline_.ticks[tick_index];
  RetimedFrame planned;
  const std::int32_t selected = tick.frame[camera_];
  const std::int32_t nearest = is_excluded(selected) ? -1 : selected;
  if (nearest >= 0) {
    planned = {RetimedFrame::Kind::kUnchanged, nearest, -1, 0,
               tick.time_ns + tick.difference[camera_]};
  }
  const bool stays = nearest >= 0 && std::abs(tick.difference[camera_]) <= near_enough;
  if (options_.method == RetimeMethod::kNearest || stays) return planned;
  const auto after = std::ranges::upper_bound(usable_, tick.time_ns, {}, &Usable::time);
  if (after == usable_.begin() || after == usable_.end()) return planned;
  const Usable &a = *(after - 1), &b = *after;
  if (b.time - a.time > longest) return planned;
  return {RetimedFrame::Kind::kInterpolated, a.frame, b.frame,
          static_cast<double>(tick.time_ns - a.time) / static_cast<double>(b.time - a.time),
          tick.time_ns};
}

std::vector<RetimedFrame> plan_retiming(const Timeline& timeline, std::size_t camera,
                                        const std::vector<Nanoseconds>& times,
                                        const RetimeOptions& options) {
  const RetimePlanner planner(timeline, camera, times, options);
  std::vector<RetimedFrame> plan;
  plan.reserve(timeline.ticks.size());
  for (std::size_t tick = 0; tick < timeline.ticks.size(); ++tick) {
    plan.push_back(planner.plan(tick));
  }
  return plan;
}

bool RetimeOptions::is_valid(std::string* reason) const {
  return is_within("JPEG quality", quality, 1, 100, reason) &&
         is_within("largest gap (ns)", static_cast<double>(max_gap), 0, 1e18, reason);
}

}  // namespace raystage::store
