// SPDX-License-Identifier: Apache-2.0
// Assigns the frames of all cameras to ticks of a constant rate: each frame goes to its nearest
// tick within the tolerance. Inputs: frame times per camera, rate, tolerance and range in ns;
// output: per tick and camera a frame index or -1. Cost: O(frames + ticks x cameras).
#include "store/timeline.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/error.h"
#include "base/resources.h"
#include "store/tick_phase.h"

namespace raystage::store {
namespace {

constexpr std::uint64_t kMaxTicks = 10'000'000;  // 92 hours at 30 frames per second

std::vector<std::vector<Nanoseconds>> frame_times(const Take& take) {
  std::vector<std::vector<Nanoseconds>> times(static_cast<std::size_t>(take.camera_count()));
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    const auto frames = take.archive(camera).frames();
    auto& column = times[camera];
    column.reserve(frames.size());
    for (const FrameRecord& frame : frames) column.push_back(frame.time_ns);
  }
  return times;
}

Nanoseconds median_of(std::vector<Nanoseconds> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// The times of ticks at a constant rate, each rounded separately: no error accumulates.
class Ticks {
 public:
  Ticks(double origin, double period) : origin_(origin), period_(period) {}
  Nanoseconds time(std::int64_t k) const {
    return static_cast<Nanoseconds>(std::llround(origin_ + static_cast<double>(k) * period_));
  }
  std::int64_t nearest(Nanoseconds time) const {
    return static_cast<std::int64_t>(std::llround((static_cast<double>(time) - origin_) / period_));
  }

 private:
  double origin_, period_;
};

/// Returns the distance of any two times without overflow.
std::uint64_t apart(Nanoseconds a, Nanoseconds b) {
  const auto u = static_cast<std::uint64_t>(a), v = static_cast<std::uint64_t>(b);
  return a > b ? u - v : v - u;
}

// Returns the instant of a still light field: the middle of all times, or their median if that is
// not within `tolerance` of all.
Nanoseconds still_instant(const std::vector<std::vector<Nanoseconds>>& times,
                          Nanoseconds tolerance) {
  std::vector<Nanoseconds> all;
  for (const auto& column : times) all.insert(all.end(), column.begin(), column.end());
  const auto [earliest, latest] = std::ranges::minmax(all);
  const Nanoseconds middle = earliest + (latest - earliest) / 2;
  return latest - middle <= tolerance ? middle : median_of(std::move(all));
}

void fill(Timeline& timeline, const std::vector<std::vector<Nanoseconds>>& times,
          const Ticks& ticks, std::int64_t first) {
  for (FrameSelection& tick : timeline.ticks) {
    tick.frame.assign(times.size(), -1);
    tick.difference.assign(times.size(), 0);
  }
  for (std::size_t camera = 0; camera < times.size(); ++camera) {
    for (std::size_t i = 0; i < times[camera].size(); ++i) {
      const Nanoseconds time = times[camera][i];
      if (time == kExcludedTime) continue;
      const std::int64_t k = ticks.nearest(time) - first;
      if (k < 0 || k >= static_cast<std::int64_t>(timeline.ticks.size())) continue;
      FrameSelection& tick = timeline.ticks[k];
      const Nanoseconds difference = time - tick.time_ns;
      if (std::abs(difference) > timeline.tolerance) continue;
      // Of two frames at one tick use the nearer, the earlier at a tie.
      if (tick.frame[camera] >= 0 && std::abs(tick.difference[camera]) <= std::abs(difference)) {
        continue;
      }
      tick.frame[camera] = static_cast<std::int32_t>(i);
      tick.difference[camera] = difference;
    }
  }
}

}  // namespace

void ClockSteps::add(const ClockStep& step) {
  auto at = std::ranges::lower_bound(steps_, step.time_ns, {}, &ClockStep::time_ns);
  if (at == steps_.end() || at->time_ns != step.time_ns) {
    at = steps_.insert(at, ClockStep{step.time_ns, 0});
    sums_.push_back(0);
  }
  at->step_ns += step.step_ns;
  for (auto i = static_cast<std::size_t>(at - steps_.begin()); i < steps_.size(); ++i) {
    sums_[i] = (i > 0 ? sums_[i - 1] : 0) + steps_[i].step_ns;
  }
}

Nanoseconds ClockSteps::sum_until(Nanoseconds stamp) const {
  const auto after = std::ranges::upper_bound(steps_, stamp, {}, &ClockStep::time_ns);
  return after == steps_.begin() ? 0 : sums_[static_cast<std::size_t>(after - steps_.begin()) - 1];
}

Nanoseconds CameraClock::corrected(Nanoseconds stamp) const {
  return stamp - offset_ns - steps.sum_until(stamp);
}

std::uint64_t most_ticks(std::size_t cameras) {
  constexpr std::size_t kAllocation = 2 * sizeof(std::size_t);  // overhead of a vector's memory
  const std::size_t of_cameras = cameras * (sizeof(std::int32_t) + sizeof(Nanoseconds));
  const std::size_t in_memory = sizeof(FrameSelection) + 2 * kAllocation + of_cameras;
  const std::size_t in_file = sizeof(Nanoseconds) + of_cameras;  // read into a buffer that doubles
  return std::min<std::uint64_t>(kMaxTicks, available_memory() / 2 / (in_memory + 2 * in_file));
}

TimeRange running_range(const std::vector<std::vector<Nanoseconds>>& times) {
  std::vector<Nanoseconds> first, last;
  for (const auto& column : times) {
    const auto trusted = [](Nanoseconds time) { return time != kExcludedTime; };
    const auto begin = std::ranges::find_if(column, trusted);
    if (begin == column.end()) continue;
    first.push_back(*begin);
    last.push_back(*std::find_if(column.rbegin(), column.rend(), trusted));
  }
  if (first.empty()) return {};
  const std::size_t half = (first.size() - 1) / 2;  // index of the ceil(n/2)-th
  std::ranges::sort(first);
  std::ranges::sort(last, std::greater());
  return {first[half], std::max(first[half], last[half])};
}

Nanoseconds FrameSelection::spread() const {
  Nanoseconds earliest = std::numeric_limits<Nanoseconds>::max();
  Nanoseconds latest = std::numeric_limits<Nanoseconds>::min();
  for (std::size_t i = 0; i < frame.size(); ++i) {
    if (frame[i] < 0) continue;
    earliest = std::min(earliest, difference[i]);
    latest = std::max(latest, difference[i]);
  }
  return earliest > latest ? 0 : latest - earliest;
}

int FrameSelection::present() const {
  return static_cast<int>(std::ranges::count_if(frame, [](std::int32_t f) { return f >= 0; }));
}

FrameSelection select_frames(const Take& take, Nanoseconds time, Nanoseconds tolerance) {
  FrameSelection selection;
  selection.time_ns = time;
  selection.frame.assign(static_cast<std::size_t>(take.camera_count()), -1);
  selection.difference.assign(selection.frame.size(), 0);
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    const ArchiveReader& archive = take.archive(camera);
    const auto nearest = archive.nearest_frame(time);
    if (!nearest) continue;
    const Nanoseconds frame_time = archive.frames()[*nearest].time_ns;
    if (tolerance < 0 || apart(frame_time, time) > static_cast<std::uint64_t>(tolerance)) continue;
    selection.frame[camera] = *nearest;
    selection.difference[camera] = frame_time - time;
  }
  return selection;
}

Nanoseconds default_frame_tolerance(double nominal_fps) {
  constexpr Nanoseconds kFarthest = std::numeric_limits<Nanoseconds>::max();
  if (!(nominal_fps > 0)) return kFarthest;
  const double half_a_period = static_cast<double>(kNanosecondsPerSecond) / nominal_fps / 2;
  return half_a_period < static_cast<double>(kFarthest) ? static_cast<Nanoseconds>(half_a_period)
                                                        : kFarthest;
}

std::optional<std::size_t> nearest_tick(std::span<const FrameSelection> ticks, Nanoseconds time) {
  if (ticks.empty()) return std::nullopt;
  if (ticks.size() == 1) return 0;
  auto nearest = std::ranges::lower_bound(ticks, time, {}, &FrameSelection::time_ns);
  if (nearest == ticks.end()) --nearest;
  if (nearest != ticks.begin() &&
      apart((nearest - 1)->time_ns, time) <= apart(nearest->time_ns, time)) {
    --nearest;
  }
  const double interval = static_cast<double>(apart(ticks.back().time_ns, ticks.front().time_ns)) /
                          static_cast<double>(ticks.size() - 1);
  if (static_cast<double>(apart(nearest->time_ns, time)) > interval / 2) return std::nullopt;
  return static_cast<std::size_t>(nearest - ticks.begin());
}

std::vector<std::size_t> adjacent_ticks(std::span<const FrameSelection> ticks,
                                        const FrameSelection& frames) {
  const auto now = nearest_tick(ticks, frames.time_ns);
  if (!now) return {};
  std::size_t before = *now, after = *now;  // one beyond each
  if (!frames.second.empty() && ticks[*now].time_ns < frames.time_ns) ++before;
  if (!frames.second.empty() && ticks[*now].time_ns > frames.time_ns)
    after = *now - (*now > 0 ? 1 : 0);
  std::vector<std::size_t> adjacent;
  if (before > 0) adjacent.push_back(before - 1);
  if (after + 1 < ticks.size()) adjacent.push_back(after + 1);
  return adjacent;
}

Timeline build_timeline(const Take& take, double fps, Nanoseconds tolerance) {
  return build_timeline(frame_times(take), take.document().nominal_fps, fps, tolerance,
                        take.folder().string());
}

Timeline assign_ticks(const std::vector<std::vector<Nanoseconds>>& times, double fps,
                      Nanoseconds tolerance, const TimeRange& range, std::string_view name,
                      std::optional<Nanoseconds> tick_at) {
  Timeline timeline;
  timeline.fps = fps;
  timeline.tolerance = tolerance;
  const double period = static_cast<double>(kNanosecondsPerSecond) / fps;
  const Ticks ticks(tick_at ? static_cast<double>(*tick_at) : best_tick_phase(times, period),
                    period);
  const std::int64_t first = ticks.nearest(range.begin), last = ticks.nearest(range.end);
  const double count = static_cast<double>(last) - static_cast<double>(first) + 1;
  if (const std::uint64_t most = most_ticks(times.size()); count > static_cast<double>(most)) {
    throw Error::bad_input(
        fmt::format("the timeline would have {:.0f} ticks of {} cameras, allowed: {}", count,
                    times.size(), most),
        std::string(name), "Give the rate of the cameras in frames per second");
  }
  timeline.ticks.resize(last - first + 1);
  for (std::size_t k = 0; k < timeline.ticks.size(); ++k) {
    timeline.ticks[k].time_ns = ticks.time(first + static_cast<std::int64_t>(k));
  }
  fill(timeline, times, ticks, first);
  return timeline;
}

void check_timeline_settings(double fps, Nanoseconds tolerance, std::string_view name) {
  const std::string where(name);
  if (!std::isfinite(fps) || fps < 0 || fps > 1e6) {
    throw Error::bad_input(
        "a rate of " + std::to_string(fps) + " frames per second is not possible", where,
        "Give a rate above 0 and up to 1000000, or 0 to detect it");
  }
  if (tolerance < 0) {
    throw Error::bad_input("the tolerance is negative", where,
                           "Give a tolerance above 0, or 0 for half a frame time");
  }
}

Timeline build_timeline(const std::vector<std::vector<Nanoseconds>>& times, double nominal_fps,
                        double fps, Nanoseconds tolerance, std::string_view name) {
  check_timeline_settings(fps, tolerance, name);
  if (std::ranges::all_of(times, [](const auto& column) { return column.empty(); })) {
    throw Error::bad_input("the take has no frame", std::string(name), "Record or import it again");
  }
  const bool still =
      std::ranges::all_of(times, [](const auto& column) { return column.size() < 2; });

  Timeline timeline;
  timeline.fps = fps;
  if (timeline.fps == 0) timeline.fps = detect_frame_rate(times);
  if (timeline.fps == 0) timeline.fps = nominal_fps;
  if (timeline.fps == 0) timeline.fps = 1;  // a still: any rate
  const double period = static_cast<double>(kNanosecondsPerSecond) / timeline.fps;
  timeline.tolerance =
      tolerance > 0 ? tolerance : std::max<Nanoseconds>(std::llround(period / 2), 1);

  if (still) {
    timeline.ticks.resize(1);
    timeline.ticks[0].time_ns = still_instant(times, timeline.tolerance);
    fill(timeline, times, Ticks(static_cast<double>(timeline.ticks[0].time_ns), period), 0);
    return timeline;
  }
  return assign_ticks(times, timeline.fps, timeline.tolerance, running_range(times), name);
}

TimelineStatistics timeline_statistics(const Timeline& timeline) {
  TimelineStatistics result;
  if (timeline.ticks.empty()) return result;
  result.absent.assign(timeline.ticks[0].frame.size(), 0);
  std::vector<Nanoseconds> spreads;
  double sum = 0;
  for (const FrameSelection& tick : timeline.ticks) {
    spreads.push_back(tick.spread());
    sum += static_cast<double>(spreads.back());
    for (std::size_t camera = 0; camera < tick.frame.size(); ++camera) {
      result.absent[camera] += tick.frame[camera] < 0 ? 1 : 0;
    }
  }
  result.mean_spread_ns = sum / static_cast<double>(spreads.size());
  result.max_spread = std::ranges::max(spreads);
  result.median_spread = median_of(std::move(spreads));
  return result;
}

}  // namespace raystage::store
