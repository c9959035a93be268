// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"

namespace raystage::schemas {

/// The stages of a job in the order in which their tasks are queued.
enum class FarmStage { kPrepare, kRender, kVerify, kPreview };
inline constexpr std::array kFarmStages{FarmStage::kPrepare, FarmStage::kRender, FarmStage::kVerify,
                                        FarmStage::kPreview};
/// Returns "prepare", "render", "verify" or "preview".
std::string_view farm_stage_name(FarmStage stage);
/// Returns the stage with this name. Throws Error (bad input) for any other name.
FarmStage parse_farm_stage(std::string_view name);

/// The resources of one task.
struct FarmResources {
  int threads = 1;
  double memory_gb = 1;                   ///< memory budget of the renderer, GB = 10^9 bytes
  std::optional<int> minutes = {};        ///< time limit; nullopt: the scheduler's
  std::vector<std::string> options = {};  ///< sbatch options, e.g. "--partition=fast"
};

/// Schema "raystage/farm_job/1" (JOB/job.json): a shot split into tasks. Paths are the nodes'.
struct FarmJobDocument {
  /// A task of stage prepare: it derives data that several frames use.
  struct PrepareTask {
    int layer = 0;     ///< index into the shot's layers
    int tick = 0;      ///< index into the timeline of the layer's take
    std::string file;  ///< of the derived data
  };
  /// A task of stage render.
  struct Chunk {
    std::string frames;         ///< syntax of parse_frame_range()
    std::vector<int> instants;  ///< indices into `instants` on which the frames depend
  };
  /// Settings that override those of the shot.
  struct OutputOverrides {
    std::string fill, layout;  ///< empty: the shot's setting
    bool chromaticities = false, coverage = false, confidence = false, deep = false;
  };
  /// A folder whose path differs on the nodes; both paths are absolute.
  struct PathMappingRule {
    std::string from, to;
  };
  /// Settings for takes whose archives are distributed over nodes: each task runs on all the nodes.
  struct Distributed {
    std::vector<std::string> nodes;  ///< host names
    std::string mpirun = "mpirun";   ///< command with its arguments
    std::string missing_archives = "error", fragments = "float";
    std::optional<int> fragment_quality = {};
  };
  enum class Engine { kSlurm, kLocal, kOpenJd };

  std::string id;
  Engine engine = Engine::kSlurm;
  Nanoseconds submitted_utc = 0;
  std::string submitted_by, submitted_on, program_version;
  std::string build;  ///< build of the submitting program; empty: any build may run it
  std::string simd = "sse4";
  std::optional<int> umask = {};
  std::string program = "raystage", command_prefix;
  std::string folder;       ///< the job folder
  std::string shot;         ///< source of JOB/shot.json, as a path on the submitting host
  std::string shot_folder;  ///< base of the relative paths in JOB/shot.json
  std::string output;       ///< SequenceName pattern
  std::string cache, color_config;
  std::string existing = "skip", missing = "error", rotten = "absent";
  OutputOverrides picture = {};
  std::array<FarmResources, kFarmStages.size()> resources = {};  ///< by stage
  int attempts = 3;
  double least_coverage =
      0;  ///< share of the view that cameras must see, [0, 1]; the job names frames below
  bool preview = true;
  int max_array_size = 1000;
  std::optional<int> max_minutes = {};  ///< time limit of the partition; nullopt: unlimited
  std::optional<double> seconds_per_frame = {};  ///< wall-clock seconds of the measured frame
  double frame_bytes = 0;  ///< free space that one frame needs on a node's output disk
  std::vector<PrepareTask> instants = {};
  std::vector<Chunk> chunks = {};
  std::vector<std::string> pinned = {};     ///< files that are not evicted until the job ends
  std::vector<std::string> inputs = {};     ///< files that a node must be able to read
  std::vector<PathMappingRule> paths = {};  ///< from the submitting host to the nodes
  std::optional<Distributed> distributed = {};

  const FarmResources& of(FarmStage stage) const {
    return resources[static_cast<std::size_t>(stage)];
  }
  FarmResources& of(FarmStage stage) { return resources[static_cast<std::size_t>(stage)]; }
};

std::string_view farm_engine_name(FarmJobDocument::Engine engine);

/// Parses the document. Throws Error (bad input) with the file, the JSON pointer, the value found
/// and what is allowed. `name`: the file name in errors.
FarmJobDocument parse_farm_job(std::string_view text, std::string_view name);
std::string format_farm_job(const FarmJobDocument& job);

}  // namespace raystage::schemas
