// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/time.h"
#include "ingest/record/recorder.h"
#include "ingest/record/recording_take.h"
#include "schemas/record_config.h"
#include "schemas/take_document.h"

namespace raystage::cli {

/// What a take and its mirror are opened with.
struct TakeSetup {
  bool resume = false;
  const std::filesystem::path& config_folder;
  const schemas::RecordConfig& config;
  const std::vector<ingest::RecorderCamera>& cameras;
  const std::string& node;
  std::optional<Nanoseconds> start_utc = {};
  std::optional<double> duration_s = {};
  schemas::TakeDocument document = {};  ///< of a new take
};

/// Returns the folder of the mirror's copy of a take, below the folder `parent`; empty if `parent`
/// is empty: there is no mirror. Throws Error (bad input) if `parent` does not exist, because its
/// disk may not be mounted, or if one copy would be the other or inside of it. Prints a warning if
/// both are on one file system.
std::filesystem::path mirror_of(const std::filesystem::path& take,
                                const std::filesystem::path& parent);

/// Creates or resumes the take in `folder`. `mirror`: folder of the mirror; empty: none.
ingest::RecordingTake open_take(const TakeSetup& setup, const std::filesystem::path& folder,
                                const std::filesystem::path& mirror);

/// Opens the mirror's copy; none if `folder` is empty. When a take is resumed, the copy that has
/// fewer frames is completed from the other.
std::optional<ingest::RecordingTake> open_mirror(const TakeSetup& setup,
                                                 const std::filesystem::path& folder,
                                                 ingest::RecordingTake& take);

}  // namespace raystage::cli
