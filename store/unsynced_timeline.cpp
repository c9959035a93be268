// SPDX-License-Identifier: Apache-2.0
// Makes the timeline of takes whose cameras agree already. An instant gets one tick in the middle
// of the time stamps; equal time stamps get the ticks of build_timeline(), provided that these use
// every frame. Cost: linear in the frames.
#include "store/unsynced_timeline.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <numeric>
#include <vector>

#include "store/take.h"

namespace raystage::store {
namespace {

constexpr double kRateOfAnInstant = 24;  // frames per second, where the take states none

Timeline instant_of(const Take& take, const std::vector<std::vector<Nanoseconds>>& times) {
  Nanoseconds earliest = std::numeric_limits<Nanoseconds>::max(), latest = -earliest;
  for (const auto& of_camera : times) {
    if (of_camera.empty()) continue;
    earliest = std::min(earliest, of_camera.front());
    latest = std::max(latest, of_camera.front());
  }
  FrameSelection tick;
  tick.time_ns = std::midpoint(earliest, latest);  // as a resynchronisation would
  for (const auto& of_camera : times) {
    tick.frame.push_back(of_camera.empty() ? -1 : 0);
    tick.difference.push_back(of_camera.empty() ? 0 : of_camera.front() - tick.time_ns);
  }
  Timeline timeline;
  timeline.fps = take.document().nominal_fps > 0 ? take.document().nominal_fps : kRateOfAnInstant;
  timeline.ticks.push_back(std::move(tick));
  return timeline;
}

bool uses_every_frame(const Timeline& timeline, std::size_t frames, std::size_t cameras) {
  return timeline.ticks.size() == frames &&
         std::ranges::all_of(timeline.ticks, [cameras](const FrameSelection& tick) {
           return static_cast<std::size_t>(tick.present()) == cameras;
         });
}

}  // namespace

std::optional<Timeline> timeline_without_sync(const Take& take) {
  if (take.are_archives_unknown()) return std::nullopt;
  std::vector<std::vector<Nanoseconds>> times, of_present;
  std::size_t most = 0;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    std::vector<Nanoseconds>& of_camera = times.emplace_back();
    for (const auto& frame : take.archive(camera).frames()) of_camera.push_back(frame.time_ns);
    most = std::max(most, of_camera.size());
    if (!take.is_missing(camera)) of_present.push_back(of_camera);
  }
  if (most == 0) return std::nullopt;
  if (most == 1) return instant_of(take, times);
  if (std::ranges::adjacent_find(of_present, std::not_equal_to<>()) != of_present.end()) {
    return std::nullopt;
  }
  Timeline timeline = build_timeline(take, 0, 0);
  if (!uses_every_frame(timeline, most, of_present.size())) return std::nullopt;
  return timeline;
}

}  // namespace raystage::store
