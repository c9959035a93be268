// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "compose/sequence.h"
#include "farm/job_folder.h"
#include "farm/path_map.h"
#include "store/rotten_frame.h"

namespace raystage::farm {

struct SubmissionOptions {
  std::filesystem::path shot;
  std::string output;  ///< SequenceName pattern
  std::optional<std::vector<int>> frames = {};
  schemas::FarmJobDocument::Engine engine = schemas::FarmJobDocument::Engine::kSlurm;
  compose::ExistingFiles existing = compose::ExistingFiles::kError;
  compose::MissingFrames missing = compose::MissingFrames::kError;
  store::RottenFrames rotten = store::RottenFrames::kAbsent;
  schemas::FarmJobDocument::OutputOverrides picture = {};
  std::filesystem::path color_config = {};
  /// Empty: the takes, or a folder next to the output if a take is read-only.
  std::filesystem::path cache = {};
  std::optional<int> chunk = {};  ///< frames per task; none: automatic_chunk_size()
  bool preview_first = false;     ///< every tenth frame first
  bool preview = true;
  int threads = 0;                  ///< of a task; 0: those of this process, at most 8
  double memory_gb = 0;             ///< of a task; 0: from the memory plan and the measured frame
  std::optional<int> minutes = {};  ///< of a task; none: from the measured frame
  bool measure = true;              ///< render the first frame here, to measure it
  int attempts = 3;
  double least_coverage = 0;  ///< share of the view that cameras must see, [0, 1]
  std::string command_prefix = {};
  std::string program = {};  ///< on the nodes; empty: the mapped path of this program
  std::string simd = {};     ///< empty: avx2, or this machine's best level if it lacks avx2
  std::vector<PathMappingRule> paths = {};
  /// Options by stage.
  std::array<std::vector<std::string>, schemas::kFarmStages.size()> sbatch = {};
  bool after = false;  ///< wait for a live job of the same output
  /// Nodes that hold the archives; engine slurm only. The submitting host needs only the documents
  /// of the takes.
  std::optional<schemas::FarmJobDocument::Distributed> distributed = {};
  std::function<void(std::string_view)> on_message = [](std::string_view) {};
};

/// A job as it would be queued.
struct PlannedJob {
  schemas::FarmJobDocument job;
  schemas::FarmRound round;  ///< the first
  std::string shot_text;
};

/// Checks everything and plans the job. Renders and queues nothing, and writes nothing except the
/// output folder. The job has no folder yet. Throws Error as check_sequence() does, and if a job of
/// the same output is not over.
PlannedJob plan_submission(const SubmissionOptions& options);

/// Checks everything, writes the job folder with its scripts, measures the first frame if requested
/// and pins stored derived data. Queues nothing. Leaves nothing behind if it throws.
JobFolder write_submission(const SubmissionOptions& options, const std::stop_token& stop);

}  // namespace raystage::farm
