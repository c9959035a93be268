// SPDX-License-Identifier: Apache-2.0
// Keeps a timeline when frames are lost: its ticks stay, and frames are found again by their times.
// A new one would have other ticks, so that all pictures of the take would change. Cost: linear in
// ticks times cameras, and a binary search for each frame.
#include "store/fixity/renumber_timeline.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "base/contained_path.h"
#include "base/error.h"
#include "store/timeline_file.h"

namespace raystage::store {
namespace {

std::vector<std::vector<Nanoseconds>> frame_times_of(const Take& take) {
  std::vector<std::vector<Nanoseconds>> times;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    std::vector<Nanoseconds>& of_camera = times.emplace_back();
    for (const FrameRecord& frame : take.archive(camera).frames()) {
      of_camera.push_back(frame.time_ns);
    }
  }
  return times;
}

}  // namespace

std::optional<NumberedTimeline> read_numbered_timeline(const std::filesystem::path& take_folder) {
  try {
    const Take take(take_folder);
    if (!exists(take.file(kTimelineFile))) return std::nullopt;
    return NumberedTimeline{read_timeline(take), frame_times_of(take)};
  } catch (const Error&) {  // whoever needs the timeline reports it
    return std::nullopt;
  }
}

bool renumber_timeline(const NumberedTimeline& before, const std::filesystem::path& take_folder) {
  try {
    const Take take(take_folder);
    const std::vector<std::vector<Nanoseconds>> now = frame_times_of(take);
    if (now.size() != before.frame_times.size()) return false;
    Timeline timeline = before.timeline;
    for (std::size_t camera = 0; camera < now.size(); ++camera) {
      const std::vector<Nanoseconds>& known = before.frame_times[camera];
      if (!std::ranges::includes(known, now[camera])) return false;
      for (FrameSelection& tick : timeline.ticks) {
        std::int32_t& frame = tick.frame[camera];
        if (frame < 0) continue;
        const auto found =
            std::ranges::lower_bound(now[camera], known[static_cast<std::size_t>(frame)]);
        const bool is_there =
            found != now[camera].end() && *found == known[static_cast<std::size_t>(frame)];
        frame = is_there ? static_cast<std::int32_t>(found - now[camera].begin()) : -1;
        if (!is_there) tick.difference[camera] = 0;
      }
    }
    write_timeline(timeline, take);
    return true;
  } catch (const Error& error) {
    if (error.exit_code() != ExitCode::kBadInput) throw;
    return false;
  }
}

}  // namespace raystage::store
