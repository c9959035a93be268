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

namespace raystage {

/// The stages whose tasks a job queues, in their order.
enum class FarmStage { kPrepare, kRender, kVerify, kPreview };
inline constexpr std::array kFarmStages{FarmStage::kPrepare, FarmStage::kRender, FarmStage::kVerify,
                                        FarmStage::kPreview};
/// "prepare", "render", "verify" or "preview".
std::string_view farm_stage_name(FarmStage stage);
/// Throws Error (bad input) for another word.
FarmStage parse_farm_stage(std::string_view name);

/// What one task may use.
struct FarmResources {
  int threads = 1;
  double memory_gb = 1;                   ///< granted to the renderer, GB = 10^9 bytes
  std::optional<int> minutes = {};        ///< time limit; none: the scheduler's
  std::vector<std::string> options = {};  ///< of sbatch, e.g. "--partition=fast"
};

/// schema "raystage/farm_job/1" (JOB/job.json): a shot as tasks. Paths are as the nodes see them.
struct FarmJobDocument {
  /// Data that is derived once: a task of stage prepare.
  struct PrepareTask {
    int layer = 0;  ///< index into the shot's layers
    int tick = 0;   ///< index into the timeline of the layer's take
    std::string file;
  };
  /// A task of stage render.
  struct Chunk {
    std::string frames;         ///< as parse_frame_range() reads them
    std::vector<int> instants;  ///< indices into `instants` that the frames wait for
  };
  /// In place of what the shot says.
  struct OutputOverrides {
    std::string fill, layout;  ///< empty: as the shot says
    bool chromaticities = false, coverage = false, confidence = false, deep = false;
  };
  /// A folder that has another name on the nodes; both paths are absolute.
  struct PathMappingRule {
    std::string from, to;
  };
  /// A job whose takes' archives are on several nodes: each task runs on all of them.
  struct Distributed {
    std::vector<std::string> nodes;  ///< by name
    std::string mpirun = "mpirun";   ///< words of a command line
    std::string missing_archives = "error", fragments = "float";
    std::optional<int> fragment_quality = {};
  };
  enum class Engine { kSlurm, kLocal, kOpenJd };

  std::string id;
  Engine engine = Engine::kSlurm;
  Nanoseconds submitted_utc = 0;
  std::string submitted_by, submitted_on, program_version;
  std::string build;  ///< of the program that made the job; empty: any may run it
  std::string simd = "sse4";
  std::optional<int> umask = {};
  std::string program = "raystage", command_prefix;
  std::string folder;       ///< the job folder
  std::string shot;         ///< that JOB/shot.json was copied from, as the submitting host saw it
  std::string shot_folder;  ///< that paths in JOB/shot.json are relative to
  std::string output;       ///< SequenceName pattern
  std::string cache, color_config;
  std::string existing = "skip", missing = "error";
  OutputOverrides picture = {};
  std::array<FarmResources, kFarmStages.size()> resources = {};  ///< by stage
  int attempts = 3;
  bool preview = true;
  int max_array_size = 1000;
  std::optional<int> max_minutes = {};           ///< time limit of the partition; none: unlimited
  std::optional<double> seconds_per_frame = {};  ///< wall-clock, of the measured frame
  double frame_bytes = 0;  ///< room that a node's output disk must have for one frame
  std::vector<PrepareTask> instants = {};
  std::vector<Chunk> chunks = {};
  std::vector<std::string> pinned = {};
  std::vector<std::string> inputs = {};     ///< files that a node must be able to read
  std::vector<PathMappingRule> paths = {};  ///< from the submitting host's names to the nodes'
  std::optional<Distributed> distributed = {};

  const FarmResources& of(FarmStage stage) const {
    return resources[static_cast<std::size_t>(stage)];
  }
  FarmResources& of(FarmStage stage) { return resources[static_cast<std::size_t>(stage)]; }
};

std::string_view farm_engine_name(FarmJobDocument::Engine engine);

FarmJobDocument read_farm_job(const std::filesystem::path& file);
/// The same in memory; `name` stands for the file in errors. Throws Error (bad input).
FarmJobDocument parse_farm_job(std::string_view text, std::string_view name);
std::string format_farm_job(const FarmJobDocument& job);

}  // namespace raystage
