// SPDX-License-Identifier: Apache-2.0
#include "farm/task_commands.h"

#include <fmt/format.h>

#include <sstream>

#include "base/child_process.h"
#include "compose/frame_range.h"
#include "farm/fingerprints.h"
#include "farm/rounds.h"

namespace raystage::farm {
namespace {

using Command = std::vector<std::string>;

void add(Command& command, std::initializer_list<std::string> words) {
  command.insert(command.end(), words);
}

void add_common(const schemas::FarmJobDocument& job, const schemas::FarmResources& resources,
                double memory_factor, Command& command) {
  add(command, {"--relative-to", job.shot_folder, "--missing", job.missing, "--threads",
                std::to_string(resources.threads), "--memory",
                fmt::format("{:.3f}", resources.memory_gb * memory_factor), "--simd", job.simd,
                "--progress", "plain"});
  if (!job.cache.empty()) add(command, {"--cache", job.cache});
  if (!job.color_config.empty()) add(command, {"--ocio", job.color_config});
}

}  // namespace

Command prepare_command(const schemas::FarmJobDocument& job, const std::filesystem::path& shot,
                        int instant, double memory_factor) {
  const schemas::FarmJobDocument::PrepareTask& wanted = job.instants[instant];
  Command command{sibling_program("raystage-prepare").string(),    shot.string(), "--instants",
                  fmt::format("{}:{}", wanted.layer, wanted.tick), "--pin",       job.id};
  add_common(job, job.of(schemas::FarmStage::kPrepare), memory_factor, command);
  return command;
}

namespace {

/// Returns the mpirun command. By default mpirun would bind each rank to a single processor.
Command ranks_command(const schemas::FarmJobDocument& job, const std::filesystem::path& shot,
                      int task) {
  const schemas::FarmJobDocument::Distributed& distributed = *job.distributed;
  Command command;
  std::istringstream words(distributed.mpirun);
  for (std::string word; words >> word;) command.push_back(word);
  add(command,
      {"--bind-to", "none", sibling_program("raystage-render-ranks").string(), shot.string(),
       "--missing-archives", distributed.missing_archives, "--fragments", distributed.fragments,
       "--fingerprints", fingerprints_file(job.folder, task).string()});
  if (distributed.fragment_quality) {
    add(command, {"--fragment-quality", std::to_string(*distributed.fragment_quality)});
  }
  return command;
}

}  // namespace

Command render_command(const schemas::FarmJobDocument& job, const std::filesystem::path& shot,
                       int task, const std::string& frames, const std::string& existing,
                       double memory_factor) {
  Command command = job.distributed
                        ? ranks_command(job, shot, task)
                        : Command{sibling_program("raystage-render").string(), shot.string()};
  add(command, {"--output", job.output, "--frames=" + frames, "--existing", existing});
  add_common(job, job.of(schemas::FarmStage::kRender), memory_factor, command);
  if (job.rotten != "absent") add(command, {"--rotten", job.rotten});
  const schemas::FarmJobDocument::OutputOverrides& picture = job.picture;
  if (!picture.fill.empty()) add(command, {"--fill", picture.fill});
  if (!picture.layout.empty()) add(command, {"--layout", picture.layout});
  if (picture.chromaticities) add(command, {"--chromaticities"});
  if (picture.coverage) add(command, {"--coverage"});
  if (picture.confidence) add(command, {"--confidence"});
  if (picture.deep) add(command, {"--deep"});
  return command;
}

Command preview_command(const schemas::FarmJobDocument& job, const JobFolder& folder) {
  Command command{sibling_program("raystage-preview").string(), job.output,
                  "--frames=" + compose::format_frame_range(job_frames(job)), "--contact-sheet",
                  (folder.path() / "contact-sheet.png").string()};
  if (job_frames(job).size() > 1) add(command, {"-o", (folder.path() / "preview.mp4").string()});
  return command;
}

compose::ShotPlanOptions plan_options(const schemas::FarmJobDocument& job) {
  compose::ShotPlanOptions options;
  apply_picture_settings(job.picture, options);
  options.color_config = job.color_config;
  options.frames = job_frames(job);
  options.folder = job.shot_folder;
  options.cache_folder = job.cache;
  return options;
}

compose::MissingFrames missing_frames_policy(const schemas::FarmJobDocument& job) {
  return job.missing == "hold"    ? compose::MissingFrames::kHold
         : job.missing == "black" ? compose::MissingFrames::kBlack
                                  : compose::MissingFrames::kError;
}

}  // namespace raystage::farm
