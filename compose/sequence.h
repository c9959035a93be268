// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "base/run_status.h"
#include "compose/sequence_memory_plan.h"
#include "compose/sequence_name.h"
#include "compose/shot_plan.h"

namespace raystage::compose {

/// What to do with frames whose file exists.
enum class ExistingFiles {
  kError,     ///< fail before anything is rendered
  kSkip,      ///< keep complete files with the current fingerprint; render the others
  kOverwrite  ///< render all frames
};

struct SequenceOptions {
  std::string output;                      ///< SequenceName pattern of .exr files
  std::optional<std::vector<int>> frames;  ///< sorted; none: all frames of the shot
  ExistingFiles existing = ExistingFiles::kError;
  MissingFrames missing = MissingFrames::kError;
  std::optional<schemas::HoleFill> fill;                             ///< replaces that of the shot
  schemas::OptionValues target;                                      ///< as ShotPlan
  DraftOptions draft;                                                ///< as ShotPlanOptions
  store::RottenFrames rotten_frames = store::RottenFrames::kAbsent;  ///< as ShotPlanOptions
  int frames_in_flight = 0;  ///< 0: one per thread of the TBB arena, at most 16
  /// Budget of frames, caches and working memory; 0: half of available_memory(), of which the cache
  /// gets at most 4 GiB.
  std::size_t memory_bytes = 0;
  std::string layout;                  ///< replaces that of the shot unless empty
  std::filesystem::path color_config;  ///< replaces that of the shot unless empty
  bool chromaticities = false;         ///< as in ExrMetadata
  std::vector<std::string> aovs;       ///< in addition to those of the shot: ShotDocument::Output
  /// Writes a deep file next to each file: SequenceName::with("deep").
  bool deep = false;
  std::filesystem::path cache_folder;         ///< as ShotPlanOptions
  std::filesystem::path folder;               ///< as ShotPlanOptions
  bool accepts_missing_archives = false;      ///< as ShotPlanOptions
  render::DistributedTakes* hosts = nullptr;  ///< as ShotPlanOptions
  /// If not empty: a text file that gets a line "FRAME FINGERPRINT" for each requested frame,
  /// before the first one is rendered.
  std::filesystem::path fingerprints_file;
  /// Share of a view, [0, 1], that cameras must see; frames with less are written and reported.
  double least_coverage = 0;
  std::string program_version;
  /// Called with values that rise from 0 to 1, from many threads.
  std::function<void(double)> progress = [](double) {};
  /// Called with one line for the log (clamped, held, skipped, failed), from many threads.
  std::function<void(std::string_view)> on_message = [](std::string_view) {};
  /// Called once with what will be rendered, after all checks and before the first frame.
  std::function<void(const ShotPlan&, std::span<const PlannedFrame>)> on_plan =
      [](const ShotPlan&, std::span<const PlannedFrame>) {};
};

/// Wall-clock time of each stage, milliseconds, summed over the frames. Several frames are in
/// flight at once; writing has its own thread.
struct StageTimes {
  double light_fields = 0, geometry = 0;
  double merge = 0;       ///< and everything else: plates, clips, colours
  double encode = 0;      ///< EXR files in memory
  double write = 0;       ///< files to the disk
  double write_wait = 0;  ///< a rendering thread waited for the queue of files
};

/// Result of render_sequence().
struct SequenceReport {
  struct Failure {
    int frame = 0;
    std::string what;
    bool is_bad_input = false;  ///< another attempt would fail, too
  };
  int requested = 0, rendered = 0, skipped = 0;
  RunStatus status = RunStatus::kNotRun;
  std::vector<Failure> failures;           ///< by frame
  std::vector<int> frames_below_coverage;  ///< complete frames below the least coverage, ascending
  std::vector<int> frames_with_rot;        ///< complete; cameras with rotten frames are absent
  double seconds = 0;                      ///< wall-clock, of the frames
  std::int64_t bytes_written = 0, pixels_decoded = 0;
  /// Numbers of light field frames whose depths were estimated, or read from files. A frame counts
  /// again if its depths were evicted from memory.
  int light_field_frames_estimated = 0, light_field_frames_loaded = 0;
  int frames_read_ahead = 0;  ///< camera frames requested from the disk before they were decoded
  std::size_t decoded_bytes_cached = 0;  ///< peak of the decoded frames in the cache
  StageTimes milliseconds;
  store::DecodeCosts decoding;  ///< part of the time of light fields
  int frames_in_flight = 1;     ///< largest number at once

  /// Returns kSuccess only if every requested frame is complete; kFellShort if so, but some are
  /// below the least coverage or lack rotten cameras; kBadInput if bad input caused all failures
  /// and no frame exists.
  ExitCode exit_code() const;
  /// Returns one line: frames, frames per second, decoded pixels, bytes written, peak memory.
  std::string summary() const;
  /// Returns one line: time of each stage per frame.
  std::string stages() const;
};

/// A sequence that check_sequence() accepted.
struct CheckedSequence {
  std::unique_ptr<const ShotPlan> plan;
  std::vector<PlannedFrame> frames;
  SequenceName name;
  SequenceMemoryPlan memory;
};

/// Performs all checks of render_sequence() that come before the first frame: shot, takes, files,
/// memory, output folder (which it creates) and disk space. Throws Error as render_sequence().
CheckedSequence check_sequence(const std::filesystem::path& shot_file,
                               const SequenceOptions& options);

/// Renders the frames of a shot to EXR files, several frames in flight. Calls check_sequence()
/// first; a frame that fails later is reported, and the others continue. Each file is written whole
/// or not at all. `stop` cancels the frames in flight within milliseconds; before the first frame
/// it throws Cancelled. Uses the current TBB arena; the bytes do not depend on its size. Throws
/// Error if nothing can be rendered, std::bad_alloc if out of memory.
SequenceReport render_sequence(const std::filesystem::path& shot_file,
                               const SequenceOptions& options, std::stop_token stop);

/// Returns the requested frames that belong to the shot, sorted; all frames of the shot if none are
/// requested. Reports the number of others by `say`. Throws Error (bad input) if no frame is left.
std::vector<int> frames_to_render(const schemas::ShotDocument& shot,
                                  const std::optional<std::vector<int>>& requested,
                                  const std::function<void(std::string_view)>& say);

/// Returns "renders/SHOT_LAYER.####.exr" in the folder of the shot, with the name of its first
/// layer, and "renders/SHOT_LAYER_draft..." with that of the first visible one for drafts. SHOT is
/// the shot's name, or its file's without one.
std::string default_output(const std::filesystem::path& shot_file,
                           const schemas::ShotDocument& shot, bool is_draft = false);

}  // namespace raystage::compose
