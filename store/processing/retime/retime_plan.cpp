// SPDX-License-Identifier: Apache-2.0
// Chooses the source frames of every tick for one camera. A frame near its tick stays unchanged.
// Otherwise the tick is interpolated between the frames before and after it, if their distance is
// small enough. Frames with a rolling shutter never stay unchanged if another one is near enough.
// Input: a timeline and corrected times, ns. Output: one RetimedFrame per tick. Cost: O(ticks log
// frames).
#include "store/processing/retime/retime_plan.h"

#include <algorithm>
#include <cmath>

#include "base/options.h"
#include "rig/row_times.h"

namespace raystage::store {
namespace {

constexpr double kMaxGapInTicks = 2.5;

}  // namespace

RetimePlanner::RetimePlanner(const Timeline& timeline, std::size_t camera,
                             const std::vector<Nanoseconds>& times, const RetimeOptions& options,
                             double line_time_us)
    : timeline_(timeline),
      camera_(camera),
      options_(options),
      // Only optical flow moves rows.
      line_time_us_(options.method == RetimeMethod::kFlow ? line_time_us : 0) {
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

const RetimePlanner::Usable* RetimePlanner::nearest_other(const Usable& frame) const {
  const Usable* nearest = nullptr;
  const auto distance = [&](const Usable& other) { return std::abs(other.time - frame.time); };
  const auto after = std::ranges::upper_bound(usable_, frame.time, {}, &Usable::time);
  const auto last = usable_.end() - after > 0 ? after + 1 : after;
  for (auto other = after - std::min<std::ptrdiff_t>(2, after - usable_.begin()); other != last;
       ++other) {
    if (other->frame == frame.frame) continue;
    if (nearest == nullptr || distance(*other) < distance(*nearest)) nearest = &*other;
  }
  return nearest;
}

RetimedFrame RetimePlanner::between(const Usable& a, const Usable& b, Nanoseconds time) const {
  const Nanoseconds interval = b.time - a.time;
  return {RetimedFrame::Kind::kInterpolated,
          a.frame,
          b.frame,
          static_cast<double>(time - a.time) / static_cast<double>(interval),
          rig::line_part(line_time_us_, interval),
          time};
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
    planned = {RetimedFrame::Kind::kUnchanged,         nearest, -1, 0, 0,
               tick.time_ns + tick.difference[camera_]};
  }
  const bool stays =
      nearest >= 0 && std::abs(tick.difference[camera_]) <= near_enough && line_time_us_ == 0;
  if (options_.method == RetimeMethod::kNearest || stays) return planned;
  const auto after = std::ranges::upper_bound(usable_, tick.time_ns, {}, &Usable::time);
  if (after != usable_.begin() && after != usable_.end()) {
    const Usable &a = *(after - 1), &b = *after;
    if (b.time - a.time <= longest) return between(a, b, tick.time_ns);
  }
  if (line_time_us_ == 0 || nearest < 0) return planned;
  const Usable own{nearest, planned.time};
  const Usable* other = nearest_other(own);
  if (other == nullptr || other->time == own.time || std::abs(other->time - own.time) > longest) {
    return planned;
  }
  return own.time < other->time ? between(own, *other, own.time) : between(*other, own, own.time);
}

std::vector<RetimedFrame> plan_retiming(const Timeline& timeline, std::size_t camera,
                                        const std::vector<Nanoseconds>& times,
                                        const RetimeOptions& options, double line_time_us) {
  const RetimePlanner planner(timeline, camera, times, options, line_time_us);
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
