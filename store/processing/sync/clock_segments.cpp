// SPDX-License-Identifier: Apache-2.0
// Splits the frames of each camera into segments that one clock fit can describe: at restarts of
// the recorder, and at gaps of more than 96 median frame intervals. Segments of one session of a
// node form a group with common clock steps. Cost: linear in the number of frames, plus the median
// of each camera's intervals.
#include "store/processing/sync/clock_segments.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace raystage::store {
namespace {

// Periods: across a longer gap find_phase_steps() would not detect a restart of the camera.
constexpr double kMaxSegmentGap = 96;
constexpr std::size_t kMinFramesToSplit = 32;  // fewer have no measurable period

std::size_t session_of(const CameraTimestamps& camera, Nanoseconds stamp) {
  return static_cast<std::size_t>(std::ranges::upper_bound(camera.restarts, stamp) -
                                  camera.restarts.begin());
}

double longest_gap(const CameraTimestamps& camera) {
  if (camera.stamps.size() < kMinFramesToSplit) return std::numeric_limits<double>::infinity();
  std::vector<double> intervals;
  for (std::size_t i = 1; i < camera.stamps.size(); ++i) {
    intervals.push_back(static_cast<double>(camera.stamps[i] - camera.stamps[i - 1]));
  }
  return kMaxSegmentGap * quantile(intervals, 0.5);
}

}  // namespace

std::vector<ClockSegment> split_into_segments(std::span<const CameraTimestamps> cameras) {
  std::vector<ClockSegment> parts;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const CameraTimestamps& camera = cameras[c];
    const std::vector<Nanoseconds>& stamps = camera.stamps;
    const double longest = longest_gap(camera);
    std::size_t first = 0;
    const auto add_until = [&](std::size_t end) {
      const std::size_t session = stamps.empty() ? 0 : session_of(camera, stamps[first]);
      parts.push_back({c, first, end - first, session, 0});
      first = end;
    };
    for (std::size_t i = 1; i < stamps.size(); ++i) {
      if (static_cast<double>(stamps[i] - stamps[i - 1]) > longest ||
          session_of(camera, stamps[i]) != session_of(camera, stamps[i - 1])) {
        add_until(i);
      }
    }
    add_until(stamps.size());
  }
  std::map<std::pair<std::string, std::size_t>, int> groups;
  for (const ClockSegment& part : parts) groups[{cameras[part.camera].node, part.session}] = 0;
  int next = 0;
  for (auto& [key, number] : groups) number = next++;
  for (ClockSegment& part : parts) part.group = groups[{cameras[part.camera].node, part.session}];
  return parts;
}

CameraTimestamps camera_timestamps(const CameraTimestamps& camera, const ClockSegment& part) {
  CameraTimestamps result;
  result.id = camera.id;
  result.node = camera.node;
  const auto begin = camera.stamps.begin() + static_cast<std::ptrdiff_t>(part.first);
  result.stamps.assign(begin, begin + static_cast<std::ptrdiff_t>(part.count));
  for (const FrameRecord& record : camera.missing) {
    if (part.count > 0 && record.time_ns >= result.stamps.front() &&
        record.time_ns <= result.stamps.back()) {
      result.missing.push_back(record);
    }
  }
  return result;
}

std::vector<Nanoseconds> session_clock_offsets(std::span<const ClockSegment> parts,
                                               std::span<const ClockFit> fits,
                                               std::span<const CameraTimestamps> cameras) {
  std::map<int, Nanoseconds> step_of;              // sum of the steps of a group
  std::map<std::string, std::set<int>> groups_of;  // groups of a node, in order of time
  for (std::size_t p = 0; p < parts.size(); ++p) {
    groups_of[cameras[parts[p].camera].node].insert(parts[p].group);
    if (fits[p].lattice.period <= 0) continue;  // its steps were not fitted
    Nanoseconds sum = 0;
    for (const PhaseStep& b : fits[p].phase_steps)
      sum += b.group_step < 0 ? 0 : std::llround(b.step);
    step_of[parts[p].group] = sum;
  }
  std::vector<Nanoseconds> before;
  for (const ClockSegment& part : parts) {
    Nanoseconds sum = 0;
    for (const int group : groups_of[cameras[part.camera].node]) {
      if (group < part.group) sum += step_of[group];
    }
    before.push_back(sum);
  }
  return before;
}

}  // namespace raystage::store
