// SPDX-License-Identifier: Apache-2.0
// Derives the data that the frames of a shot need and that is stored for all of them, before they
// are rendered: the camera depths of each light field frame, by the file that rendering reads.
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

#include "compose/shot_plan.h"
#include "schemas/error.h"

namespace raystage {

/// Data that a method derives once from a light field frame and stores: camera depths.
struct DerivedInstant {
  std::size_t layer = 0;       ///< index into the shot's layers
  int tick = 0;                ///< index into the timeline of the layer's take
  std::filesystem::path file;  ///< where the data is stored
  bool is_stored = false;      ///< the file exists
  std::vector<int> frames;     ///< of the shot that need it, sorted
};

/// A light field frame of a shot.
struct LayerTick {
  std::size_t layer = 0;  ///< index into the shot's layers
  int tick = 0;           ///< index into the timeline of the layer's take
  std::strong_ordering operator<=>(const LayerTick&) const = default;
};

/// Returns what the frames of a shot need, each file once, ordered by the first frame that needs
/// it. With the option `temporal` also the adjacent ticks. Layers that show nothing at a frame need
/// nothing. The file names depend on every JPEG of a light field frame: all of them are read. Of
/// `auto` nothing is known before it renders. Throws Error as LightFieldRenderer::stored_file().
std::vector<DerivedInstant> derived_instants(const ShotPlan& plan,
                                             std::span<const PlannedFrame> frames);
/// Returns those among `wanted`, and reads no other light field frames. Throws Error (bad input)
/// also where none of the frames needs one of them.
std::vector<DerivedInstant> derived_instants(const ShotPlan& plan,
                                             std::span<const PlannedFrame> frames,
                                             std::span<const LayerTick> wanted);

struct PrepareOptions {
  std::size_t memory_bytes = 0;  ///< for frames and what methods work in; 0: half of
                                 ///< available_memory(), at most 4 GiB for each
  /// Rising from 0 to 1.
  std::function<void(double)> progress = [](double) {};
  /// One line for the log: what failed.
  std::function<void(std::string_view)> say = [](std::string_view) {};
};

/// What became of the light field frames to prepare.
struct PrepareReport {
  struct Failure {
    std::size_t layer = 0;
    int tick = 0;
    std::string what;
    bool is_bad_input = false;  ///< trying again leads nowhere
  };
  int asked = 0, stored_before = 0, derived = 0;
  bool stopped = false;           ///< a stop was requested before the last one
  std::vector<Failure> failures;  ///< in the order asked for

  /// kSuccess only if all data is stored, also where nothing was asked for; kBadInput where all
  /// failed by it.
  ExitCode exit_code() const;
};

/// Derives and stores what is not stored (or stored damaged), one light field frame after the
/// other: the same bytes as rendering stores. A result that cannot be stored is a failure here.
/// Once `stop` is requested no further one is begun. Uses the TBB arena it is called in. Throws
/// std::bad_alloc when memory runs out.
PrepareReport prepare_instants(const ShotPlan& plan, std::span<const DerivedInstant> instants,
                               const PrepareOptions& options, std::stop_token stop);

/// Keeps the folders of these files from eviction until unpinned: a file `pin.JOB` in each folder,
/// created if missing; pins older than 30 days no longer count. Throws Error as pin_depth_set().
void pin_derived(std::span<const std::filesystem::path> files, std::string_view job);
/// A missing pin is no error.
void unpin_derived(std::span<const std::filesystem::path> files, std::string_view job);

/// Returns the line that render and prepare print: "depths of N light field frames solved, of M
/// read".
std::string stored_data_text(int solved, int read);

}  // namespace raystage
