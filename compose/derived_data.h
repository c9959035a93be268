// SPDX-License-Identifier: Apache-2.0
// Derives and stores, before rendering, the data that many frames of a shot share: the camera
// depths of each light field frame, in the files that rendering reads.
#pragma once

#include <compare>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "base/run_status.h"
#include "compose/shot_plan.h"

namespace raystage::compose {

/// Data that a method derives once from a light field frame and stores: camera depths.
struct DerivedFrameData {
  std::size_t layer = 0;       ///< index into the shot's layers
  int tick = 0;                ///< as ShownTick::tick: beyond the timeline for exact times
  std::filesystem::path file;  ///< where the data is stored
  bool is_stored = false;      ///< the file exists
  std::vector<int> frames;     ///< of the shot that need it, sorted
  std::vector<render::VirtualCamera> shown_views = {};  ///< as ReconstructionOptions
};

/// Identifies a light field frame of a shot.
struct LayerTick {
  std::size_t layer = 0;  ///< index into the shot's layers
  int tick = 0;           ///< as ShownTick::tick: beyond the timeline for exact times
  std::strong_ordering operator<=>(const LayerTick&) const = default;
};

/// Returns the data that the frames of a shot need, each file once, ordered by the first frame that
/// needs it. With the option `temporal` it includes that of adjacent ticks. Layers that are
/// invisible at a frame need nothing. File names depend on every JPEG of a light field frame, so
/// all are read. The method `auto` is omitted: it chooses a method only when it renders. Throws
/// Error as LightFieldRenderer::stored_file().
std::vector<DerivedFrameData> list_derived_data(const ShotPlan& plan,
                                                std::span<const PlannedFrame> frames);
/// Returns the data for the light field frames in `wanted` only, and reads no others. Throws Error
/// (bad input) also if no frame needs one of them.
std::vector<DerivedFrameData> list_derived_data(const ShotPlan& plan,
                                                std::span<const PlannedFrame> frames,
                                                std::span<const LayerTick> wanted);

struct PrepareOptions {
  /// Budget of decoded frames and working memory; 0: half of available_memory(), at most 4 GiB for
  /// each.
  std::size_t memory_bytes = 0;
  /// Called with values that rise from 0 to 1.
  std::function<void(double)> progress = [](double) {};
  /// Called with one line for the log for each failure.
  std::function<void(std::string_view)> on_message = [](std::string_view) {};
};

/// Result of prepare_derived_data().
struct PrepareReport {
  struct Failure {
    std::size_t layer = 0;
    int tick = 0;
    std::string what;
    bool is_bad_input = false;  ///< another attempt would fail, too
  };
  int requested = 0, stored_before = 0, derived = 0;
  RunStatus status = RunStatus::kNotRun;
  std::vector<Failure> failures;  ///< in the order of the request

  /// Returns kSuccess only if all requested data is stored; kBadInput if bad input caused all
  /// failures and nothing is stored.
  ExitCode exit_code() const;
};

/// Derives and stores the data that is missing or damaged, one light field frame at a time, with
/// the same bytes as rendering stores. Data that cannot be stored is a failure. A requested `stop`
/// cancels the current light field frame within milliseconds. Uses the current TBB arena. Throws
/// std::bad_alloc when memory runs out.
PrepareReport prepare_derived_data(const ShotPlan& plan, std::span<const DerivedFrameData> instants,
                                   const PrepareOptions& options, std::stop_token stop);

/// Protects the folders of these files from eviction until they are unpinned, at most 30 days:
/// writes a file `pin.JOB` to each folder, creating it if needed. Throws Error as pin_depth_set().
void pin_derived_data(std::span<const std::filesystem::path> files, std::string_view job);
/// Removes these pins. A missing pin is no error.
void unpin_derived_data(std::span<const std::filesystem::path> files, std::string_view job);

/// Returns the line that the commands print: "depths of N light field frames solved, of M read".
std::string format_stored_data_counts(int solved, int read);

}  // namespace raystage::compose
