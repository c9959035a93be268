// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "store/timeline.h"

namespace raystage::store {

/// What refers to the frames of a take by their numbers, and the times of these frames. A repair
/// that loses or restores frames gives those after them other numbers.
struct NumberedFrames {
  /// By camera; nullopt if the archive cannot be read.
  std::vector<std::optional<std::vector<Nanoseconds>>> times;
  std::optional<Timeline> timeline;  ///< nullopt if there is none or it is not valid
};

/// Returns what a repair must renumber. Empty if the take cannot be opened.
NumberedFrames read_numbered_frames(const std::filesystem::path& take_folder);

/// Writes a timeline with the same ticks for archives of which frames were lost since: these are
/// absent from it. Returns false, and writes nothing, if the archives have frames that it does not
/// know, or cannot be read.
bool renumber_timeline(const NumberedFrames& before, const std::filesystem::path& take_folder);

/// Writes the list of imported depth maps with the frames' new numbers. Maps of lost frames are
/// left out of it. Returns how many; leaves a list that cannot be read as it is.
std::int64_t renumber_imported_depths(const NumberedFrames& before,
                                      const std::filesystem::path& take_folder);

}  // namespace raystage::store
