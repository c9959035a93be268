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

#include "compose/memory_plan.h"
#include "compose/sequence_name.h"
#include "compose/shot_plan.h"
#include "schemas/error.h"

namespace raystage {

/// What to do about frames whose file is there already.
enum class ExistingFiles {
  kError,     ///< refuse before anything is rendered
  kSkip,      ///< keep files that are whole and carry the fingerprint; render the others anew
  kOverwrite  ///< render all
};

struct SequenceOptions {
  std::string output;                      ///< SequenceName pattern of .exr files
  std::optional<std::vector<int>> frames;  ///< sorted; none: all of the shot
  ExistingFiles existing = ExistingFiles::kError;
  MissingFrames missing = MissingFrames::kError;
  std::optional<HoleFill> fill;  ///< in place of what the shot says
  OptionValues target;           ///< as ShotPlan
  int frames_in_flight = 0;      ///< 0: one per thread of the TBB arena, at most 16
  std::size_t memory_bytes = 0;  ///< for frames, cache, what methods keep and work in; 0: half of
                                 ///< available_memory(), at most 4 GiB of cache
  std::string layout;            ///< not empty: in place of the shot's
  std::filesystem::path color_config;  ///< not empty: in place of the shot's
  bool chromaticities = false;         ///< as in ExrMetadata
  std::vector<std::string> aovs;       ///< beside the shot's: see ShotDocument::Output
  /// Beside each file one of the samples that it is made of: SequenceName::with("deep").
  bool deep = false;
  std::filesystem::path cache_folder;  ///< as ShotPlanOptions
  std::filesystem::path folder;        ///< as ShotPlanOptions
  TakeHosts* hosts = nullptr;          ///< as ShotPlanOptions
  /// Not empty: the fingerprint of each frame asked for is written there, a line "FRAME
  /// FINGERPRINT" each, before the first is rendered.
  std::filesystem::path fingerprints_file;
  std::string program_version;
  /// Rising from 0 to 1; called from many threads.
  std::function<void(double)> progress = [](double) {};
  /// One line for the log: what was clamped, held, skipped or failed; called from many threads.
  std::function<void(std::string_view)> say = [](std::string_view) {};
};

/// Where the time of a sequence went: wall-clock milliseconds, summed over the frames, of which
/// several are under way at once. Only writing runs beside the threads that render.
struct StageTimes {
  double light_fields = 0, geometry = 0;
  double merge = 0;    ///< and all else: plates, clips, colours
  double encode = 0;   ///< to EXR, in memory
  double write = 0;    ///< to the disk
  double held_up = 0;  ///< finished frames waited for the disk, holding up a thread that renders
};

/// What became of a sequence.
struct SequenceReport {
  struct Failure {
    int frame = 0;
    std::string what;
    bool is_bad_input = false;  ///< trying again leads nowhere
  };
  int asked = 0, rendered = 0, skipped = 0;
  bool stopped = false;           ///< a stop was requested before the last frame
  std::vector<Failure> failures;  ///< by frame
  double seconds = 0;             ///< wall-clock, of the frames
  std::int64_t bytes_written = 0, pixels_decoded = 0;
  /// Light field frames whose depths were solved, and read from files; one counts again after its
  /// depths were dropped from memory.
  int instants_solved = 0, instants_read = 0;
  int frames_read_ahead = 0;           ///< of cameras, asked of the disk before they were decoded
  std::size_t decoded_bytes_held = 0;  ///< the most that was kept of decoded frames after a frame
  StageTimes milliseconds;
  DecodeCosts decoding;  ///< a part of what light fields take
  int in_flight = 1;     ///< frames under way at once, at most

  /// kSuccess only if every frame asked for is there, whole; kBadInput where all failed by it.
  ExitCode exit_code() const;
  /// One line: frames, frames per second, decoded pixels, bytes written, peak memory.
  std::string summary() const;
  /// One line: what the stages took for a frame.
  std::string stages() const;
};

/// What render_sequence() would render.
struct CheckedSequence {
  std::unique_ptr<const ShotPlan> plan;
  std::vector<PlannedFrame> frames;
  SequenceName name;
  MemoryPlan memory;
};

/// Checks everything that can be checked before the first frame, as render_sequence() does: shot,
/// takes, files, memory, the output folder (which it makes) and the room in it. Throws Error as
/// that does.
CheckedSequence check_sequence(const std::filesystem::path& shot_file,
                               const SequenceOptions& options);

/// Renders a shot's frames to EXR files, several frames in flight. Everything that can be is
/// checked before the first one; a frame that fails later is reported and the others go on. Files
/// appear whole or not at all. Once `stop` is requested frames under way are dropped. Uses the TBB
/// arena it is called in; the bytes do not depend on its size. Throws Error where nothing can be
/// rendered, std::bad_alloc when memory runs out.
SequenceReport render_sequence(const std::filesystem::path& shot_file,
                               const SequenceOptions& options, std::stop_token stop);

/// Returns the frames of the shot among those asked for, sorted; all of the shot where none are
/// named. Says how many lie outside. Throws Error (bad input) where all do.
std::vector<int> frames_to_render(const ShotDocument& shot,
                                  const std::optional<std::vector<int>>& asked,
                                  const std::function<void(std::string_view)>& say);

/// "renders/SHOT_LAYER.####.exr" beside the shot.
std::string default_output(const std::filesystem::path& shot_file, const ShotDocument& shot);

}  // namespace raystage
