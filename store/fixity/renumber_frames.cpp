// SPDX-License-Identifier: Apache-2.0
// Keeps a timeline and imported depth maps when a repair changes the numbers of frames: these are
// found again by their times. A new timeline would have other ticks, so that all pictures of the
// take would change. Cost: linear in ticks times cameras, and a binary search for each frame.
#include "store/fixity/renumber_frames.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "base/contained_path.h"
#include "base/error.h"
#include "schemas/imported_depths_document.h"
#include "store/imported_depths.h"
#include "store/timeline_file.h"

namespace raystage::store {
namespace {

using Times = std::vector<Nanoseconds>;

std::vector<std::optional<Times>> frame_times_of(const Take& take) {
  std::vector<std::optional<Times>> all;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    std::optional<Times>& times = all.emplace_back();
    try {
      const auto frames = take.archive(camera).frames();
      times.emplace();
      for (const FrameRecord& frame : frames) times->push_back(frame.time_ns);
    } catch (const Error&) {  // whoever needs the archive reports it
    }
  }
  return all;
}

/// Returns the number among the frames `now` of a frame of `before`; -1 if it is lost.
std::int32_t new_number(std::int32_t number, const Times& before, const Times& now) {
  if (number < 0 || static_cast<std::size_t>(number) >= before.size()) return -1;
  const Nanoseconds time = before[static_cast<std::size_t>(number)];
  const auto found = std::ranges::lower_bound(now, time);
  return found != now.end() && *found == time ? static_cast<std::int32_t>(found - now.begin()) : -1;
}

}  // namespace

NumberedFrames read_numbered_frames(const std::filesystem::path& take_folder) {
  NumberedFrames result;
  try {
    const Take take(take_folder);
    result.times = frame_times_of(take);
    if (exists(take.file(kTimelineFile))) result.timeline = read_timeline(take);
  } catch (const Error&) {  // whoever needs it reports it
  }
  return result;
}

bool renumber_timeline(const NumberedFrames& before, const std::filesystem::path& take_folder) {
  if (!before.timeline) return false;
  try {
    const Take take(take_folder);
    const auto now = frame_times_of(take);
    if (now.size() != before.times.size()) return false;
    Timeline timeline = *before.timeline;
    for (std::size_t camera = 0; camera < now.size(); ++camera) {
      const std::optional<Times>&known = before.times[camera], &found = now[camera];
      if (!known || !found || !std::ranges::includes(*known, *found)) return false;
      for (FrameSelection& tick : timeline.ticks) {
        std::int32_t& frame = tick.frame[camera];
        if (frame < 0) continue;
        frame = new_number(frame, *known, *found);
        if (frame < 0) tick.difference[camera] = 0;
      }
    }
    write_timeline(timeline, take);
    return true;
  } catch (const Error& error) {
    if (error.exit_code() != ExitCode::kBadInput) throw;
    return false;
  }
}

std::int64_t renumber_imported_depths(const NumberedFrames& before,
                                      const std::filesystem::path& take_folder) {
  using Document = schemas::ImportedDepthsDocument;
  const Take take(take_folder);
  Document document;
  try {
    document = read_imported_depths(take);
  } catch (const Error& error) {  // whoever needs it reports it
    if (error.exit_code() != ExitCode::kBadInput) throw;
    return 0;
  }
  const Document old = document;
  const auto now = frame_times_of(take);
  std::int64_t lost = 0;
  for (Document::Camera& camera : document.cameras) {
    const int index = take.camera_index(camera.id);
    const auto at = static_cast<std::size_t>(index);
    if (index < 0 || at >= before.times.size() || !before.times[at] || !now[at]) continue;
    std::int32_t last = -1;
    const auto is_lost = [&](Document::Map& map) {
      const bool was_known = static_cast<std::size_t>(map.frame) < before.times[at]->size();
      if (was_known) map.frame = new_number(map.frame, *before.times[at], *now[at]);
      if (map.frame <= last) return true;
      last = map.frame;
      return false;
    };
    lost += static_cast<std::int64_t>(std::erase_if(camera.maps, is_lost));
  }
  if (document != old) {
    require_contained(take.file(Document::kFile));
    schemas::write_imported_depths(document, take.folder() / Document::kFile);
  }
  return lost;
}

}  // namespace raystage::store
