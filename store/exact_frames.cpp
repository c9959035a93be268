// SPDX-License-Identifier: Apache-2.0
#include "store/exact_frames.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <optional>
#include <span>

#include "rig/row_times.h"

namespace raystage::store {
namespace {

constexpr double kMaxGap = 2.5;       // ticks: bridges one lost frame, but not two
constexpr double kUnchanged = 0.005;  // ticks from the frame's time
constexpr std::ptrdiff_t kSearched =
    5;  // ticks to each side: frames are at most one tick from theirs

/// A frame of a camera, at its own time.
struct TimedFrame {
  std::int32_t frame = -1;
  Nanoseconds time = 0;
};

std::optional<TimedFrame> frame_of(const FrameSelection& tick, std::size_t camera) {
  if (tick.frame[camera] < 0) return std::nullopt;
  return TimedFrame{tick.frame[camera], tick.time_ns + tick.difference[camera]};
}

/// Returns the frame of a camera nearest to `kept`, another one of the camera, among the ticks.
std::optional<TimedFrame> nearest_other(std::span<const FrameSelection> ticks, std::size_t camera,
                                        const TimedFrame& kept) {
  std::optional<TimedFrame> nearest;
  const auto distance = [&](const TimedFrame& other) { return std::abs(other.time - kept.time); };
  for (const FrameSelection& tick : ticks) {
    const auto found = frame_of(tick, camera);
    if (!found || found->time == kept.time) continue;
    if (!nearest || distance(*found) < distance(*nearest)) nearest = found;
  }
  return nearest;
}

/// Selects the picture at a time between two frames of a camera.
void select_between(FrameSelection& selected, std::size_t camera, const TimedFrame& a,
                    const TimedFrame& b, Nanoseconds time, double line_time_us) {
  const Nanoseconds interval = b.time - a.time;
  selected.second.resize(selected.frame.size());
  selected.frame[camera] = a.frame;
  selected.second[camera] = {b.frame,
                             static_cast<double>(time - a.time) / static_cast<double>(interval),
                             rig::line_part(line_time_us, interval)};
}

}  // namespace

FrameSelection frames_at_time(const Timeline& timeline, const rig::Rig& rig, Nanoseconds time) {
  const std::vector<FrameSelection>& ticks = timeline.ticks;
  if (ticks.size() == 1) return ticks.front();
  const double period = static_cast<double>(kNanosecondsPerSecond) / timeline.fps;
  const auto longest = static_cast<Nanoseconds>(std::llround(kMaxGap * period));
  const auto unchanged = static_cast<Nanoseconds>(kUnchanged * period);
  const std::ptrdiff_t after =
      std::ranges::upper_bound(ticks, time, {}, &FrameSelection::time_ns) - ticks.begin();
  const auto begin = std::max<std::ptrdiff_t>(0, after - kSearched);
  const auto end = std::min(static_cast<std::ptrdiff_t>(ticks.size()), after + kSearched);
  const std::optional<std::size_t> nearest = nearest_tick(ticks, time);

  const std::size_t cameras = ticks.front().frame.size();
  FrameSelection selected{
      time, std::vector<std::int32_t>(cameras, -1), std::vector<Nanoseconds>(cameras, 0), {}};
  for (std::size_t camera = 0; camera < cameras; ++camera) {
    std::optional<TimedFrame> before, next;
    for (std::ptrdiff_t i = begin; i < end; ++i) {
      const auto found = frame_of(ticks[static_cast<std::size_t>(i)], camera);
      if (!found) continue;
      if (found->time <= time && (!before || found->time > before->time)) before = found;
      if (found->time > time && (!next || found->time < next->time)) next = found;
    }
    const double line_time_us = rig.cameras[camera].line_time_us;
    std::optional<TimedFrame> kept;
    // A frame with a rolling shutter has one row only that shows its time.
    if (line_time_us == 0) {
      if (before && time - before->time <= unchanged) kept = before;
      if (next && next->time - time <= unchanged && !kept) kept = next;
    }
    if (!kept && before && next && next->time - before->time <= longest) {
      select_between(selected, camera, *before, *next, time, line_time_us);
      continue;
    }
    if (!kept && nearest) kept = frame_of(ticks[*nearest], camera);
    if (!kept) continue;
    selected.difference[camera] = kept->time - time;
    if (line_time_us != 0) {
      const auto other = nearest_other(std::span(ticks).subspan(begin, end - begin), camera, *kept);
      if (other && std::abs(other->time - kept->time) <= longest) {
        const bool is_first = kept->time < other->time;
        select_between(selected, camera, is_first ? *kept : *other, is_first ? *other : *kept,
                       kept->time, line_time_us);
        continue;
      }
    }
    selected.frame[camera] = kept->frame;
  }
  return selected;
}

}  // namespace raystage::store
