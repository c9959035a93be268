// SPDX-License-Identifier: Apache-2.0
// Resynchronises the free-running cameras of a take (docs/resync.md). Splits the frames of each
// camera into segments, fits their clocks (clock_fit.h), corrects the time stamps (segment_sync.h)
// and joins the segments. Chooses the phase of the ticks and assigns the nearest frame of every
// camera to each tick (store/timeline.h). Times in ns. Cost: O(frames log frames) per camera.
#include "store/processing/sync/resync.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <span>

#include "base/error.h"
#include "base/options.h"
#include "base/parallel.h"
#include "store/processing/sync/losses.h"
#include "store/processing/sync/segment_sync.h"
#include "store/recordings.h"

namespace raystage::store {
namespace {

constexpr double kLate = 5;  // periods
constexpr Nanoseconds kMinLate = kNanosecondsPerSecond;
constexpr double kSameRate = 0.1;  // relative tolerance of a multiple of a period

Nanoseconds earliest_of(const std::vector<CameraTimestamps>& cameras) {
  Nanoseconds earliest = std::numeric_limits<Nanoseconds>::max();
  for (const CameraTimestamps& camera : cameras) {
    if (!camera.stamps.empty()) earliest = std::min(earliest, camera.stamps.front());
  }
  return earliest;
}

// Returns the period that most cameras have; of two equally frequent ones the longer, so that every
// camera has a frame at every tick.
double common_period(const std::vector<CameraClock>& clocks) {
  std::vector<double> periods;
  for (const CameraClock& clock : clocks) {
    if (clock.period_ns > 0) periods.push_back(clock.period_ns);
  }
  if (periods.empty()) return 0;
  std::ranges::sort(periods);
  return periods[periods.size() / 2];
}

double drift_of(double period, double tick) {
  const double ratio = period >= tick ? period / tick : tick / period;
  const double multiple = std::round(ratio);
  if (std::abs(ratio - multiple) > kSameRate * multiple) return 0;  // another rate
  const double relative = period >= tick ? ratio / multiple : multiple / ratio;
  return (relative - 1) * 1e6;
}

std::vector<NodeClockStep> node_steps(const std::vector<CameraTimestamps>& cameras,
                                      const std::vector<ClockSegment>& parts,
                                      const std::vector<ClockFit>& fits) {
  struct Sum {
    NodeClockStep step;
    std::set<std::size_t> cameras;
    std::vector<Nanoseconds> times;
  };
  std::map<std::pair<int, int>, Sum> sums;
  for (std::size_t p = 0; p < fits.size(); ++p) {
    const CameraTimestamps& camera = cameras[parts[p].camera];
    for (const PhaseStep& b : fits[p].phase_steps) {
      if (b.group_step < 0) continue;
      Sum& sum = sums[{parts[p].group, b.group_step}];
      sum.step.node = camera.node;
      sum.step.step = std::llround(b.step);
      if (b.first_frame >= parts[p].count) continue;
      sum.cameras.insert(parts[p].camera);
      sum.times.push_back(camera.stamps[parts[p].first + b.first_frame] - sum.step.step);
    }
  }
  std::vector<NodeClockStep> steps;
  for (auto& [key, sum] : sums) {
    if (sum.times.empty()) continue;
    sum.step.cameras = static_cast<int>(sum.cameras.size());
    sum.step.time = std::ranges::min(sum.times);
    steps.push_back(sum.step);
  }
  std::ranges::stable_sort(steps, {}, &NodeClockStep::time);
  return steps;
}

std::vector<RecordingPause> pauses_of(const std::vector<CameraTimestamps>& cameras,
                                      const std::vector<ClockSegment>& parts,
                                      const std::vector<SegmentSync>& synced) {
  std::map<int, std::pair<RecordingPause, std::size_t>> of_group;  // first and last time; session
  for (std::size_t p = 0; p < parts.size(); ++p) {
    for (const Nanoseconds time : synced[p].times) {
      if (time == kExcludedTime) continue;
      const std::string& node = cameras[parts[p].camera].node;
      const auto found = of_group.try_emplace(
          parts[p].group, std::pair(RecordingPause{node, time, time}, parts[p].session));
      RecordingPause& runs = found.first->second.first;
      runs.begin = std::min(runs.begin, time);
      runs.end = std::max(runs.end, time);
    }
  }
  std::vector<RecordingPause> pauses;
  const RecordingPause* before = nullptr;
  for (const auto& [group, runs] : of_group) {
    if (before != nullptr && before->node == runs.first.node) {
      pauses.push_back({before->node, before->end, runs.first.begin});
    }
    before = &runs.first;
  }
  return pauses;
}

ClockFits fit_parts(const std::vector<CameraTimestamps>& cameras,
                    const std::vector<ClockSegment>& parts, Nanoseconds base) {
  std::vector<std::vector<double>> relative(parts.size());
  std::vector<int> group;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const auto stamps =
        std::span(cameras[parts[p].camera].stamps).subspan(parts[p].first, parts[p].count);
    relative[p].reserve(stamps.size());
    for (const Nanoseconds stamp : stamps) relative[p].push_back(static_cast<double>(stamp - base));
    group.push_back(parts[p].group);
  }
  return fit_clocks(relative, group);
}

void mark_ends(ResyncResult& result, const TimeRange& range, double period) {
  const Nanoseconds late = std::max(kMinLate, static_cast<Nanoseconds>(kLate * period));
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    const TimeRange own = running_range({result.times[c]});
    if (result.cameras[c].frames == 0 || own.end == 0) continue;
    if (own.begin > range.begin + late) result.cameras[c].late_start = own.begin;
    if (own.end < range.end - late) result.cameras[c].early_end = own.end;
  }
}

void mark_start_up(ResyncResult& result) {
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    const double period = result.timeline.clocks[c].period_ns;
    std::vector<LostRun> runs;
    for (const LostRun& run : result.cameras[c].lost) {
      // A run across the end of the start-up is split there.
      const double before =
          std::ceil(static_cast<double>(*result.start_up_end - run.time) / period);
      const auto cut =
          static_cast<std::int64_t>(std::clamp(before, 0.0, static_cast<double>(run.count)));
      if (cut > 0) {
        runs.push_back({run.first, cut, run.time, std::min(run.recorded, cut), true});
      }
      if (cut < run.count) {
        runs.push_back({run.first + cut, run.count - cut,
                        run.time + std::llround(static_cast<double>(cut) * period),
                        std::max<std::int64_t>(0, run.recorded - cut), false});
      }
    }
    result.cameras[c].lost = std::move(runs);
  }
}

}  // namespace

std::int64_t CameraSync::lost_at_start_up() const {
  std::int64_t sum = 0;
  for (const LostRun& run : lost) sum += run.start_up ? run.count : 0;
  return sum;
}
std::int64_t CameraSync::dropped() const {
  std::int64_t sum = 0;
  for (const LostRun& run : lost) sum += run.start_up ? 0 : run.count;
  return sum;
}
std::int64_t CameraSync::lost_unrecorded() const {
  std::int64_t sum = 0;
  for (const LostRun& run : lost) sum += run.start_up ? 0 : run.count - run.recorded;
  return sum;
}

bool has_arrival_timestamps(const schemas::TakeDocument& take) {
  return take.timestamp_event == "arrival";
}

std::vector<CameraTimestamps> camera_timestamps(const Take& take) {
  std::vector<CameraTimestamps> cameras;
  std::vector<std::vector<Nanoseconds>> restarts = recorder_restarts(take);
  for (int c = 0; c < take.camera_count(); ++c) {
    const schemas::TakeDocument::Camera& document = take.document().cameras[c];
    CameraTimestamps camera;
    camera.id = document.id;
    camera.node = document.node;
    camera.restarts = std::move(restarts[c]);
    for (const FrameRecord& record : take.archive(c).records()) {
      if (record.status != FrameStatus::kStored) camera.missing.push_back(record);
    }
    for (const FrameRecord& frame : take.archive(c).frames()) {
      camera.stamps.push_back(frame.time_ns);
    }
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

bool ResyncOptions::is_valid(std::string* reason) const {
  return is_within("rate (frames per second, 0: detected)", fps, 0, 1e6, reason) &&
         is_within("nominal rate (frames per second)", nominal_fps, 0, 1e6, reason) &&
         is_within("tolerance (ns)", static_cast<double>(tolerance), 0, 1e18, reason);
}

ResyncResult resynchronise(const std::vector<CameraTimestamps>& cameras,
                           const ResyncOptions& options, std::string_view name) {
  require_valid(options, name);
  if (std::ranges::all_of(cameras, [](const CameraTimestamps& c) { return c.stamps.empty(); })) {
    throw Error::bad_input("the take has no frames", std::string(name),
                           "Record or import it again");
  }
  const Nanoseconds base = earliest_of(cameras);
  const std::vector<ClockSegment> parts = split_into_segments(cameras);
  const ClockFits fits = fit_parts(cameras, parts, base);

  ResyncResult result;
  const auto offset_of = [&](std::size_t c) {
    return options.offsets.empty() ? 0 : options.offsets[c];
  };
  result.method = fits.method;
  result.least_squares_ppm = fits.least_squares_ppm;
  result.envelope_ppm = fits.envelope_ppm;
  result.times.resize(cameras.size());
  result.cameras.resize(cameras.size());
  std::vector<CameraClock> clocks(cameras.size());
  const std::vector<Nanoseconds> stepped = session_clock_offsets(parts, fits.cameras, cameras);
  std::vector<SegmentSync> synced(parts.size());
  parallel_for(std::size_t{0}, parts.size(), [&](std::size_t p) {
    const std::size_t c = parts[p].camera;
    synced[p] = sync_segment(camera_timestamps(cameras[c], parts[p]), fits.cameras[p],
                             offset_of(c) + stepped[p], base, options.trust_timestamps);
  });
  for (std::size_t begin = 0; begin < parts.size();) {
    const std::size_t c = parts[begin].camera;
    std::size_t end = begin;
    while (end < parts.size() && parts[end].camera == c) ++end;
    SegmentSync whole = join_segments(
        cameras[c], std::span(parts).subspan(begin, end - begin),
        std::span(fits.cameras).subspan(begin, end - begin),
        std::span<const SegmentSync>(synced).subspan(begin, end - begin), offset_of(c));
    clocks[c] = std::move(whole.clock);
    result.cameras[c] = std::move(whole.sync);
    result.times[c] = std::move(whole.times);
    begin = end;
  }
  result.steps = node_steps(cameras, parts, fits.cameras);
  result.pauses = pauses_of(cameras, parts, synced);

  const bool single_frames =
      std::ranges::all_of(cameras, [](const auto& c) { return c.stamps.size() < 2; });
  double period = common_period(clocks);
  if (single_frames || period == 0) {
    // Too few frames to fit clocks: ticks are computed from the times alone.
    if (options.tick_at) {
      throw Error::bad_input("a take with one frame per camera has one tick, at these frames",
                             std::string(name), "Leave out the time of a tick");
    }
    result.timeline =
        build_timeline(result.times, options.nominal_fps, options.fps, options.tolerance, name);
    result.timeline.clocks = std::move(clocks);
    return result;
  }
  const double own_period = period;
  if (options.fps > 0) period = static_cast<double>(kNanosecondsPerSecond) / options.fps;
  const double fps =
      options.fps > 0 ? options.fps : static_cast<double>(kNanosecondsPerSecond) / period;
  const Nanoseconds tolerance = options.tolerance > 0
                                    ? options.tolerance
                                    : std::max<Nanoseconds>(std::llround(period / 2), 1);
  TimeRange range = running_range(result.times);
  result.start_up_end = find_start_up_end(result.cameras, clocks, result.times, range, own_period);
  if (result.start_up_end && !options.keep_start_up) {
    range.begin = std::min(*result.start_up_end, range.end);
  }
  result.timeline = assign_ticks(result.times, fps, tolerance, range, name, options.tick_at);
  for (CameraClock& clock : clocks) {
    if (clock.period_ns > 0) clock.drift_ppm = drift_of(clock.period_ns, own_period);
  }
  result.timeline.clocks = std::move(clocks);
  if (result.start_up_end) mark_start_up(result);
  mark_ends(result, range, own_period);
  return result;
}

}  // namespace raystage::store
