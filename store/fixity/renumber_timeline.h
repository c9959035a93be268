// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "store/timeline.h"

namespace raystage::store {

/// A timeline and the times of the frames to which its numbers refer, per camera.
struct NumberedTimeline {
  Timeline timeline;
  std::vector<std::vector<Nanoseconds>> frame_times;
};

/// Returns the timeline of a take; nullopt if there is none or it is not valid.
std::optional<NumberedTimeline> read_numbered_timeline(const std::filesystem::path& take_folder);

/// Writes a timeline with the same ticks for archives of which frames were lost since: these are
/// absent from it. Returns false, and writes nothing, if the archives have frames that it does not
/// know, or cannot be read.
bool renumber_timeline(const NumberedTimeline& before, const std::filesystem::path& take_folder);

}  // namespace raystage::store
