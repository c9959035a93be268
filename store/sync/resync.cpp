// SPDX-License-Identifier: Apache-2.0
#include "store/sync/resync.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "schemas/error.h"
#include "schemas/parallel.h"
#include "store/sync/losses.h"
#include "store/tick_phase.h"

namespace raystage {
namespace {

constexpr std::size_t kLeastToFit = 32;  // frames: fewer say less than their own stamps
constexpr double kLate = 5;              // periods
constexpr Nanoseconds kLateAtLeast = kNanosecondsPerSecond;
constexpr double kSameRate = 0.1;  // a period counts as a multiple within this

std::vector<int> groups_of(const std::vector<CameraStamps>& cameras) {
  std::map<std::string, int> numbers;
  std::vector<int> groups;
  for (const CameraStamps& camera : cameras) {
    groups.push_back(
        numbers.try_emplace(camera.node, static_cast<int>(numbers.size())).first->second);
  }
  return groups;
}

Nanoseconds earliest_of(const std::vector<CameraStamps>& cameras) {
  Nanoseconds earliest = std::numeric_limits<Nanoseconds>::max();
  for (const CameraStamps& camera : cameras) {
    if (!camera.stamps.empty()) earliest = std::min(earliest, camera.stamps.front());
  }
  return earliest;
}

CameraClock clock_of(const CameraStamps& camera, const ClockFit& fit, Nanoseconds offset,
                     Nanoseconds base) {
  CameraClock clock;
  clock.offset_ns = offset;
  for (const PhaseBreak& b : fit.breaks) {
    if (b.group_step < 0 || b.first_frame >= camera.stamps.size()) continue;
    const ClockStep step{camera.stamps[b.first_frame], std::llround(b.step)};
    if (!clock.steps.empty() && clock.steps.back().time_ns == step.time_ns) {
      clock.steps.back().step_ns += step.step_ns;
    } else {
      clock.steps.push_back(step);
    }
  }
  if (!fit.regular) return clock;
  clock.period_ns = fit.lattice.period;
  clock.jitter_ns = fit.jitter;
  std::size_t middle = camera.stamps.size() / 2;
  while (middle + 1 < fit.slots.size() && fit.slots[middle] == kNoSlot) ++middle;
  if (fit.slots[middle] != kNoSlot) {
    clock.phase_ns = static_cast<double>(base - offset) + fit.lattice.at(fit.slots[middle]) +
                     fit.own_shift(middle);
  }
  return clock;
}

// When each frame was exposed, as well as is known; kNoTime where it is not.
std::vector<Nanoseconds> exposure_times(const CameraStamps& camera, const ClockFit& fit,
                                        const CameraClock& clock, Nanoseconds base) {
  std::vector<Nanoseconds> times;
  times.reserve(camera.stamps.size());
  if (!clock.fitted) {
    for (const Nanoseconds stamp : camera.stamps) times.push_back(clock.corrected(stamp));
    return times;
  }
  double shift = 0;
  std::size_t next = 0;
  for (std::size_t i = 0; i < camera.stamps.size(); ++i) {
    for (; next < fit.breaks.size() && fit.breaks[next].first_frame <= i; ++next) {
      if (fit.breaks[next].group_step < 0) shift += fit.breaks[next].step;
    }
    times.push_back(fit.is_outlier(i) ? kNoTime
                                      : base - clock.offset_ns +
                                            std::llround(fit.lattice.at(fit.slots[i]) + shift));
  }
  return times;
}

std::vector<Outlier> outliers_of(const CameraStamps& camera, const ClockFit& fit) {
  std::vector<Outlier> outliers;
  for (std::size_t i = 0; i < fit.slots.size(); ++i) {
    if (!fit.is_outlier(i)) continue;
    outliers.push_back({static_cast<std::int32_t>(i), camera.stamps[i],
                        std::llround(fit.residual[i]), fit.slots[i] == kNoSlot});
  }
  return outliers;
}

CameraSync sync_of(const CameraStamps& camera, const ClockFit& fit, const CameraClock& clock,
                   Nanoseconds base) {
  CameraSync sync;
  sync.id = camera.id;
  sync.node = camera.node;
  sync.frames = static_cast<std::int64_t>(camera.stamps.size());
  sync.regular = fit.regular;
  if (!fit.regular) return sync;
  sync.period_sigma_ppm = fit.period_sigma / fit.lattice.period * 1e6;
  sync.lost = lost_runs(camera, fit, clock, base);
  sync.outliers = outliers_of(camera, fit);
  for (const PhaseBreak& b : fit.breaks) {
    if (b.group_step >= 0 || b.first_frame >= camera.stamps.size()) continue;
    sync.jumps.push_back({camera.stamps[b.first_frame], std::llround(b.step)});
  }
  return sync;
}

// The period that most cameras share; the longer one where two are as common, so that every camera
// has a frame at every tick.
double common_period(const std::vector<ClockFit>& fits) {
  std::vector<double> periods;
  for (const ClockFit& fit : fits) {
    if (fit.regular) periods.push_back(fit.lattice.period);
  }
  if (periods.empty()) return 0;
  std::ranges::sort(periods);
  return periods[periods.size() / 2];
}

double drift_of(double period, double tick) {
  const double ratio = period >= tick ? period / tick : tick / period;
  const double multiple = std::round(ratio);
  if (std::abs(ratio - multiple) > kSameRate * multiple) return 0;  // of another rate altogether
  const double relative = period >= tick ? ratio / multiple : multiple / ratio;
  return (relative - 1) * 1e6;
}

std::vector<NodeStep> node_steps(const std::vector<CameraStamps>& cameras,
                                 const std::vector<ClockFit>& fits, const std::vector<int>& group) {
  struct Sum {
    NodeStep step;
    std::vector<Nanoseconds> times;
  };
  std::map<std::pair<int, int>, Sum> sums;
  for (std::size_t c = 0; c < fits.size(); ++c) {
    for (const PhaseBreak& b : fits[c].breaks) {
      if (b.group_step < 0) continue;
      Sum& sum = sums[{group[c], b.group_step}];
      sum.step.node = cameras[c].node;
      sum.step.step = std::llround(b.step);
      if (b.first_frame >= cameras[c].stamps.size()) continue;
      ++sum.step.cameras;
      sum.times.push_back(cameras[c].stamps[b.first_frame] - sum.step.step);
    }
  }
  std::vector<NodeStep> steps;
  for (auto& [key, sum] : sums) {
    if (sum.times.empty()) continue;
    sum.step.time = std::ranges::min(sum.times);
    steps.push_back(sum.step);
  }
  std::ranges::stable_sort(steps, {}, &NodeStep::time);
  return steps;
}

void mark_ends(Resync& result, const TimeRange& range, double period) {
  const Nanoseconds late = std::max(kLateAtLeast, static_cast<Nanoseconds>(kLate * period));
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    const TimeRange own = running_range({result.times[c]});
    if (result.cameras[c].frames == 0 || own.end == 0) continue;
    if (own.begin > range.begin + late) result.cameras[c].late_start = own.begin;
    if (own.end < range.end - late) result.cameras[c].early_end = own.end;
  }
}

void mark_start_up(Resync& result) {
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    const double period = result.timeline.clocks[c].period_ns;
    std::vector<LostRun> runs;
    for (const LostRun& run : result.cameras[c].lost) {
      // A run over the end of the start-up counts in two parts.
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

bool marks_arrivals(const TakeDocument& take) { return take.time_marks == "arrival"; }

std::vector<CameraStamps> stamps_of(const Take& take) {
  std::vector<CameraStamps> cameras;
  for (int c = 0; c < take.camera_count(); ++c) {
    const TakeDocument::Camera& document = take.document().cameras[static_cast<std::size_t>(c)];
    CameraStamps camera;
    camera.id = document.id;
    camera.node = document.node;
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

Resync resynchronise(const std::vector<CameraStamps>& cameras, const ResyncSettings& settings,
                     std::string_view name) {
  check_settings(settings.fps, settings.tolerance, name);
  if (std::ranges::all_of(cameras, [](const CameraStamps& c) { return c.stamps.empty(); })) {
    throw Error::bad_input("the take holds no frame", std::string(name),
                           "Record or import it again");
  }
  const Nanoseconds base = earliest_of(cameras);
  const std::vector<int> group = groups_of(cameras);
  std::vector<std::vector<double>> relative(cameras.size());
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    relative[c].reserve(cameras[c].stamps.size());
    for (const Nanoseconds stamp : cameras[c].stamps) {
      relative[c].push_back(static_cast<double>(stamp - base));
    }
  }
  const ClockFits fits = fit_clocks(relative, group);
  relative = {};

  Resync result;
  result.method = fits.method;
  result.least_squares_ppm = fits.least_squares_ppm;
  result.envelope_ppm = fits.envelope_ppm;
  result.times.resize(cameras.size());
  result.cameras.resize(cameras.size());
  std::vector<CameraClock> clocks(cameras.size());
  parallel_for(std::size_t{0}, cameras.size(), [&](std::size_t c) {
    const ClockFit& fit = fits.cameras[c];
    const Nanoseconds offset = settings.offsets.empty() ? 0 : settings.offsets[c];
    clocks[c] = clock_of(cameras[c], fit, offset, base);
    clocks[c].fitted =
        !settings.exact_stamps && fit.regular && cameras[c].stamps.size() >= kLeastToFit;
    result.times[c] = exposure_times(cameras[c], fit, clocks[c], base);
    result.cameras[c] = sync_of(cameras[c], fit, clocks[c], base);
  });
  result.steps = node_steps(cameras, fits.cameras, group);

  const bool still =
      std::ranges::all_of(cameras, [](const auto& c) { return c.stamps.size() < 2; });
  double period = common_period(fits.cameras);
  if (still || period == 0) {
    // Too few frames for a rhythm: ticks from the times alone.
    if (settings.tick_at) {
      throw Error::bad_input("with one frame a camera there is one tick, where the frames are",
                             std::string(name), "Leave out the time of a tick");
    }
    result.timeline =
        build_timeline(result.times, settings.nominal_fps, settings.fps, settings.tolerance, name);
    result.timeline.clocks = std::move(clocks);
    return result;
  }
  const double own_period = period;
  if (settings.fps > 0) period = static_cast<double>(kNanosecondsPerSecond) / settings.fps;
  const double fps =
      settings.fps > 0 ? settings.fps : static_cast<double>(kNanosecondsPerSecond) / period;
  const Nanoseconds tolerance = settings.tolerance > 0
                                    ? settings.tolerance
                                    : std::max<Nanoseconds>(std::llround(period / 2), 1);
  TimeRange range = running_range(result.times);
  result.start_up_end = find_start_up_end(result.cameras, clocks, result.times, range, own_period);
  if (result.start_up_end && !settings.keep_start_up) {
    range.begin = std::min(*result.start_up_end, range.end);
  }
  result.timeline = assign_ticks(result.times, fps, tolerance, range, name, settings.tick_at);
  for (CameraClock& clock : clocks) {
    if (clock.period_ns > 0) clock.drift_ppm = drift_of(clock.period_ns, own_period);
  }
  result.timeline.clocks = std::move(clocks);
  if (result.start_up_end) mark_start_up(result);
  mark_ends(result, range, own_period);
  return result;
}

}  // namespace raystage
