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

struct Usable {
  std::int32_t frame;
  Nanoseconds time;
};

std::vector<Usable> usable_frames(const std::vector<Nanoseconds>& times) {
  std::vector<Usable> usable;
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (times[i] == kExcludedTime) continue;
    if (!usable.empty() && times[i] <= usable.back().time) continue;
    usable.push_back({static_cast<std::int32_t>(i), times[i]});
  }
  return usable;
}

}  // namespace

std::vector<RetimedFrame> plan_retiming(const Timeline& timeline, std::size_t camera,
                                        const std::vector<Nanoseconds>& times,
                                        const RetimeOptions& options) {
  const double period = static_cast<double>(kNanosecondsPerSecond) / timeline.fps;
  const auto near_enough = static_cast<Nanoseconds>(kTickToleranceFraction * period);
  const Nanoseconds longest = options.max_gap > 0
                                  ? options.max_gap
                                  : static_cast<Nanoseconds>(std::llround(kMaxGapInTicks * period));
  const std::vector<Usable> usable = usable_frames(times);

  std::vector<RetimedFrame> plan;
  plan.reserve(timeline.ticks.size());
  for (const FrameSelection& tick : timeline.ticks) {
    RetimedFrame planned;
    const std::int32_t nearest = tick.frame[camera];
    if (nearest >= 0) {
      planned = {RetimedFrame::Kind::kUnchanged, nearest, -1, 0,
                 tick.time_ns + tick.difference[camera]};
    }
    const bool stays = nearest >= 0 && std::abs(tick.difference[camera]) <= near_enough;
    if (options.method != RetimeMethod::kNearest && !stays) {
      const auto after = std::ranges::upper_bound(usable, tick.time_ns, {}, &Usable::time);
      if (after != usable.begin() && after != usable.end()) {
        const Usable &a = *(after - 1), &b = *after;
        if (b.time - a.time <= longest) {
          planned = {
              RetimedFrame::Kind::kInterpolated, a.frame, b.frame,
              static_cast<double>(tick.time_ns - a.time) / static_cast<double>(b.time - a.time),
              tick.time_ns};
        }
      }
    }
    plan.push_back(planned);
  }
  return plan;
}

bool RetimeOptions::is_valid(std::string* reason) const {
  return is_within("JPEG quality", quality, 1, 100, reason) &&
         is_within("largest gap (ns)", static_cast<double>(max_gap), 0, 1e18, reason);
}

}  // namespace raystage::store
