// SPDX-License-Identifier: Apache-2.0
// Turns the clock fit of a segment into exposure times (ns), lost frames, outliers and clock steps,
// and joins the segments of a camera. Times of a fitted clock are those of the lattice (lattice.h)
// plus the camera's own phase steps; without a fit they are the corrected time stamps. Cost: linear
// in the number of frames.
#include "store/processing/sync/segment_sync.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <span>

#include "store/processing/sync/losses.h"

namespace raystage::store {
namespace {

constexpr std::size_t kMinFramesToFit = 32;  // with fewer, time stamps are more accurate

CameraClock clock_of(const CameraTimestamps& camera, const ClockFit& fit, Nanoseconds offset,
                     Nanoseconds base) {
  CameraClock clock;
  clock.offset_ns = offset;
  for (const PhaseStep& b : fit.phase_steps) {
    if (b.group_step < 0 || b.first_frame >= camera.stamps.size()) continue;
    clock.steps.add({camera.stamps[b.first_frame], std::llround(b.step)});
  }
  if (!fit.regular) return clock;
  clock.period_ns = fit.lattice.period;
  clock.jitter_ns = fit.jitter;
  std::size_t middle = camera.stamps.size() / 2;
  while (middle + 1 < fit.slots.size() && fit.slots[middle] == kNoSlot) ++middle;
  if (fit.slots[middle] != kNoSlot) {
    clock.phase_ns = static_cast<double>(base - offset) + fit.lattice.at(fit.slots[middle]) +
                     fit.own_steps_before(middle);
  }
  return clock;
}

// Returns the estimated exposure time of each frame, ns; kExcludedTime for outliers.
std::vector<Nanoseconds> exposure_times(const CameraTimestamps& camera, const ClockFit& fit,
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
    for (; next < fit.phase_steps.size() && fit.phase_steps[next].first_frame <= i; ++next) {
      if (fit.phase_steps[next].group_step < 0) shift += fit.phase_steps[next].step;
    }
    times.push_back(fit.is_outlier(i) ? kExcludedTime
                                      : base - clock.offset_ns +
                                            std::llround(fit.lattice.at(fit.slots[i]) + shift));
  }
  return times;
}

std::vector<Outlier> outliers_of(const CameraTimestamps& camera, const ClockFit& fit) {
  std::vector<Outlier> outliers;
  for (std::size_t i = 0; i < fit.slots.size(); ++i) {
    if (!fit.is_outlier(i)) continue;
    outliers.push_back({static_cast<std::int32_t>(i), camera.stamps[i],
                        std::llround(fit.residual[i]), fit.slots[i] == kNoSlot});
  }
  return outliers;
}

CameraSync sync_of(const CameraTimestamps& camera, const ClockFit& fit, const CameraClock& clock,
                   Nanoseconds base) {
  CameraSync sync;
  sync.id = camera.id;
  sync.node = camera.node;
  sync.frames = static_cast<std::int64_t>(camera.stamps.size());
  sync.regular = fit.regular;
  if (!fit.regular) return sync;
  sync.period_sigma_ppm = fit.period_sigma / fit.lattice.period * 1e6;
  sync.lost = find_lost_runs(camera, fit, clock, base);
  sync.outliers = outliers_of(camera, fit);
  for (const PhaseStep& b : fit.phase_steps) {
    if (b.group_step >= 0 || b.first_frame >= camera.stamps.size()) continue;
    sync.phase_steps.push_back({camera.stamps[b.first_frame], std::llround(b.step)});
  }
  return sync;
}

// Returns the clock steps of a camera. A step persists, so each step of a group is listed once: at
// the camera's first frame after it.
ClockSteps steps_of(const CameraTimestamps& camera, std::span<const ClockSegment> parts,
                    std::span<const ClockFit> fits) {
  ClockSteps steps;
  std::set<std::pair<int, int>> known;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    for (const PhaseStep& b : fits[p].phase_steps) {
      if (b.group_step < 0 || b.first_frame >= parts[p].count) continue;
      if (!known.insert({parts[p].group, b.group_step}).second) continue;
      steps.add({camera.stamps[parts[p].first + b.first_frame], std::llround(b.step)});
    }
  }
  return steps;
}

// First and last time that are not excluded.
struct Ends {
  Nanoseconds first = kExcludedTime, last = kExcludedTime;
};
Ends ends_of(std::span<const Nanoseconds> times) {
  Ends ends;
  for (const Nanoseconds time : times) {
    if (time == kExcludedTime) continue;
    if (ends.first == kExcludedTime) ends.first = time;
    ends.last = time;
  }
  return ends;
}

void append(CameraSync& whole, const CameraSync& part, const ClockSegment& at,
            std::int64_t period) {
  for (LostRun run : part.lost) {
    run.first += period;
    whole.lost.push_back(run);
  }
  for (Outlier outlier : part.outliers) {
    outlier.frame += static_cast<std::int32_t>(at.first);
    whole.outliers.push_back(outlier);
  }
  whole.phase_steps.insert(whole.phase_steps.end(), part.phase_steps.begin(),
                           part.phase_steps.end());
}

}  // namespace

SegmentSync sync_segment(const CameraTimestamps& camera, const ClockFit& fit, Nanoseconds offset,
                         Nanoseconds base, bool exact) {
  SegmentSync part;
  part.clock = clock_of(camera, fit, offset, base);
  part.clock.fitted = !exact && fit.regular && camera.stamps.size() >= kMinFramesToFit;
  part.times = exposure_times(camera, fit, part.clock, base);
  part.sync = sync_of(camera, fit, part.clock, base);
  return part;
}

SegmentSync join_segments(const CameraTimestamps& camera, std::span<const ClockSegment> parts,
                          std::span<const ClockFit> fits, std::span<const SegmentSync> synced,
                          Nanoseconds offset) {
  const auto longest = static_cast<std::size_t>(
      std::ranges::max_element(parts, {}, &ClockSegment::count) - parts.begin());
  SegmentSync whole;
  whole.clock = synced[longest].clock;
  whole.clock.offset_ns = offset;
  whole.clock.steps = steps_of(camera, parts, fits);
  whole.sync.id = camera.id;
  whole.sync.node = camera.node;
  whole.sync.frames = static_cast<std::int64_t>(camera.stamps.size());
  whole.sync.regular = synced[longest].sync.regular;
  whole.sync.period_sigma_ppm = synced[longest].sync.period_sigma_ppm;
  const double period = whole.clock.period_ns;
  Nanoseconds first = kExcludedTime, last = kExcludedTime;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const SegmentSync& part = synced[p];
    whole.clock.fitted |= part.clock.fitted;
    whole.times.insert(whole.times.end(), part.times.begin(), part.times.end());
    const Ends ends = ends_of(part.times);
    if (!whole.sync.regular || ends.first == kExcludedTime) continue;
    if (first == kExcludedTime) first = ends.first;
    const auto periods_until = [&](Nanoseconds time) {
      return std::llround(static_cast<double>(time - first) / period);
    };
    if (last != kExcludedTime && parts[p].session == parts[p - 1].session) {
      LostRun gap = find_lost_run_between(camera, whole.clock, last, ends.first);
      gap.first = periods_until(gap.time);
      if (gap.count > 0) whole.sync.lost.push_back(gap);
    }
    append(whole.sync, part.sync, parts[p], periods_until(ends.first));
    last = ends.last;
  }
  return whole;
}

}  // namespace raystage::store
