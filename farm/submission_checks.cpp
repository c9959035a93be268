// SPDX-License-Identifier: Apache-2.0
#include "farm/submission_checks.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <stdexcept>

#include "base/atomic_file.h"
#include "base/error.h"
#include "compose/sequence_memory_plan.h"
#include "farm/job_folder.h"
#include "farm/task_commands.h"
#include "render/distributed_rendering.h"
#include "render/methods.h"

namespace raystage::farm {
namespace {

namespace fs = std::filesystem;
using Engine = schemas::FarmJobDocument::Engine;

class UnknownArchives : public store::RemoteArchives {
 public:
  std::optional<store::ArchiveReader> open(int /*camera*/) const override {
    return store::ArchiveReader(store::ArchiveWriter::Description(), {}, nullptr);
  }
  bool is_missing(int /*camera*/) const override { return false; }
  bool are_unknown() const override { return true; }
};

/// Opens takes of which this host has only the documents (take.json, rig.json and timeline), to
/// plan a job whose archives are on its nodes. Frames come from the timeline, which is not checked.
/// Such takes cannot be rendered.
class DocumentOnlyTakes : public render::DistributedTakes {
 public:
  store::Take open(const fs::path& folder) override {
    return store::Take(folder, std::make_shared<const UnknownArchives>());
  }
  void share(const store::Take& /*take*/, render::RendererOptions& /*settings*/) override {
    throw std::logic_error("a take without archives cannot be rendered");
  }
};

void check_sbatch_options(const SubmissionOptions& options) {
  for (const auto& of_stage : options.sbatch) {
    for (const std::string& option : of_stage) {
      if (options.engine != Engine::kSlurm) {
        throw Error::bad_input("found \"" + option + "\" for a job that Slurm does not run",
                               "sbatch", "Remove the options of sbatch, or use engine slurm");
      }
      const bool is_clean =
          std::ranges::none_of(option, [](char c) { return static_cast<unsigned char>(c) < ' '; });
      if (is_clean && option.starts_with("-")) continue;
      throw Error::bad_input("found \"" + option + "\", allowed: one option of sbatch", "sbatch",
                             "Write for example --partition=fast");
    }
  }
}

/// Rejects method `auto`: each task would choose a method, and the choices could differ.
void check_methods(const compose::ShotPlan& plan, const fs::path& shot) {
  for (const compose::LightFieldLayer* light_field : plan.light_fields()) {
    if (!light_field->method().chooses_by_measuring()) continue;
    throw Error::bad_input(
        "method auto chooses again in every task, so tasks could differ",
        fmt::format("{}#/layers/{}/method", shot.string(), light_field->index()),
        "Render one frame locally and write the method that its log names into the shot");
  }
}

/// Returns whether derived data can be stored in the folders of all takes that need it.
bool are_takes_writable(const std::vector<compose::DerivedFrameData>& instants) {
  return std::ranges::all_of(instants, [](const compose::DerivedFrameData& instant) {
    fs::path folder = instant.file.parent_path();
    while (!file_exists(folder) && folder.has_relative_path()) folder = folder.parent_path();
    return access(folder.c_str(), W_OK) == 0;
  });
}

compose::SequenceOptions sequence_options(const SubmissionOptions& options, const fs::path& cache,
                                          render::DistributedTakes* hosts) {
  compose::SequenceOptions sequence;
  sequence.output = options.output;
  sequence.frames = options.frames;
  sequence.existing = options.existing;
  sequence.missing = options.missing;
  apply_picture_settings(options.picture, sequence);
  sequence.color_config = options.color_config;
  sequence.deep = options.picture.deep;
  sequence.cache_folder = cache;
  sequence.on_message = options.on_message;
  sequence.hosts = hosts;
  return sequence;
}

void check_distributed(const SubmissionOptions& options) {
  if (!options.distributed) return;
  if (options.engine != Engine::kSlurm) {
    throw Error::bad_input("archives on several nodes need engine slurm", "distributed",
                           "Use engine slurm, or copy the archives into one take");
  }
  if (!options.command_prefix.empty()) {
    throw Error::bad_input("the ranks of a distributed job cannot run in a container",
                           "distributed",
                           "Install Raystage on the nodes, and set no command prefix");
  }
  if (options.distributed->nodes.size() < 2) {
    throw Error::bad_input(
        fmt::format("found {} nodes for a distributed job, at least 2 are needed",
                    options.distributed->nodes.size()),
        "distributed", "Name the nodes that hold the archives");
  }
}

void check_memory(const SubmissionOptions& options, const compose::CheckedSequence& sequence) {
  if (options.memory_gb <= 0) return;
  const double needed =
      1e-9 * compose::required_memory(*sequence.plan, sequence.frames, 1, options.picture.deep);
  if (needed <= options.memory_gb) return;
  throw Error::bad_input(
      fmt::format("one frame needs {:.2f} GB, a task gets {:.2f} GB", needed, options.memory_gb),
      options.shot.string(), "Give tasks more memory");
}

}  // namespace

SubmissionCheckResult check_submission(const SubmissionOptions& options) {
  check_sbatch_options(options);
  check_distributed(options);
  DocumentOnlyTakes documents;
  render::DistributedTakes* hosts = options.distributed ? &documents : nullptr;
  SubmissionCheckResult checked{
      compose::check_sequence(options.shot, sequence_options(options, options.cache, hosts)),
      {},
      options.cache};
  check_methods(*checked.sequence.plan, options.shot);
  check_memory(options, checked.sequence);
  if (options.distributed) return checked;  // ranks store the depths of their own cameras
  checked.instants = compose::list_derived_data(*checked.sequence.plan, checked.sequence.frames);
  if (checked.cache.empty() && !are_takes_writable(checked.instants)) {
    checked.cache = fs::absolute(farm_folder(options.output) / "cache");
    options.on_message("a take is read-only: derived data goes to " + checked.cache.string());
    checked.sequence =
        compose::check_sequence(options.shot, sequence_options(options, checked.cache, nullptr));
    checked.instants = compose::list_derived_data(*checked.sequence.plan, checked.sequence.frames);
  }
  return checked;
}

}  // namespace raystage::farm
