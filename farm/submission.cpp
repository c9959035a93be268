// SPDX-License-Identifier: Apache-2.0
#include "farm/submission.h"

#include <fmt/format.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <random>
#include <set>
#include <system_error>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "base/child_process.h"
#include "base/resources.h"
#include "compose/derived_data.h"
#include "compose/frame_range.h"
#include "farm/attempts.h"
#include "farm/job_plan.h"
#include "farm/node_checks.h"
#include "farm/resources.h"
#include "farm/slurm_queue.h"
#include "farm/slurm_scripts.h"
#include "farm/submission_checks.h"
#include "farm/task_commands.h"
#include "raystage_version.h"
#include "render/common/simd_level.h"

namespace raystage::farm {
namespace {

namespace fs = std::filesystem;
using Engine = schemas::FarmJobDocument::Engine;

constexpr int kMaxDefaultThreads = 8;

std::string user_name() {
  const passwd* user = getpwuid(geteuid());
  return user == nullptr ? std::to_string(geteuid()) : user->pw_name;
}

/// Returns a new id, e.g. "shot-1a2b3c4d", with characters that file names and Slurm accept.
std::string new_job_id(const std::string& output) {
  std::string name = farm_folder(output).stem().string().substr(0, 100);
  for (char& c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '-' && c != '_' && c != '.')
      c = '_';
  }
  if (std::isalnum(static_cast<unsigned char>(name.front())) == 0) name = "s" + name;
  std::random_device random;
  return fmt::format("{}-{:08x}", name, random());
}

void check_not_live(const SubmissionOptions& options) {
  if (options.after && options.engine != Engine::kSlurm) {
    throw Error::bad_input("only jobs of engine slurm can wait for other jobs", "engine",
                           "Use engine slurm, or submit once the other job is over");
  }
  const auto live = find_live_job(options.output);
  if (!live) return;
  if (!file_exists(live->job_file())) {
    throw Error::bad_input("a job of this output is being submitted", live->path().string(),
                           "Wait for it; if its submission was killed, delete the folder");
  }
  if (options.after && live->job().engine == Engine::kSlurm) return;
  if (options.after) {
    throw Error::bad_input("a job can wait only for a job of engine slurm", live->path().string(),
                           "Submit once that job is over");
  }
  throw Error::bad_input("a job of this output is not over: " + live->job().id,
                         live->path().string(),
                         "Wait for it (`raystage farm status`), cancel it, or submit with waiting "
                         "for live jobs enabled");
}

std::vector<int> numbers_of(const std::vector<compose::PlannedFrame>& frames) {
  std::vector<int> numbers;
  for (const compose::PlannedFrame& frame : frames) numbers.push_back(frame.frame);
  return numbers;
}

/// Returns the indices of the instants that the frames wait for.
std::vector<int> instants_for(const std::vector<int>& frames,
                              const std::vector<const compose::DerivedFrameData*>& missing) {
  std::vector<int> indices;
  for (std::size_t i = 0; i < missing.size(); ++i) {
    const bool needed = std::ranges::any_of(
        frames, [&](int frame) { return std::ranges::binary_search(missing[i]->frames, frame); });
    if (needed) indices.push_back(static_cast<int>(i));
  }
  return indices;
}

std::string path_text(const fs::path& path) {
  return path.empty() ? "" : fs::absolute(path).lexically_normal().string();
}

/// Returns the inputs that a node must be able to read: take.json of all takes.
std::vector<std::string> inputs_of(const compose::ShotPlan& plan) {
  std::set<std::string> inputs;
  for (const compose::LightFieldLayer* light_field : plan.light_fields()) {
    inputs.insert(path_text(light_field->take().folder() / "take.json"));
  }
  return {inputs.begin(), inputs.end()};
}

schemas::FarmJobDocument new_job(const SubmissionOptions& options,
                                 const SubmissionCheckResult& checked) {
  schemas::FarmJobDocument job;
  job.id = new_job_id(options.output);
  job.engine = options.engine;
  job.submitted_utc = utc_now();
  job.submitted_by = user_name();
  job.submitted_on = node_name();
  job.program_version = RAYSTAGE_VERSION;
  // A container may have other libraries: then the first task determines the build.
  if (options.command_prefix.empty()) job.build = build_id();
  const render::SimdLevel best = render::best_simd_level();
  job.simd = options.simd.empty()
                 ? render::simd_level_name(std::min(best, render::SimdLevel::kAvx2))
                 : options.simd;
  const mode_t mask = umask(0);
  umask(mask);
  job.umask = static_cast<int>(mask);
  job.command_prefix = options.command_prefix;
  job.program = options.program.empty()
                    ? map_path(sibling_program("raystage").string(), options.paths)
                    : options.program;
  job.shot = path_text(options.shot);
  job.shot_folder = path_text(fs::absolute(options.shot).parent_path());
  job.output = path_text(options.output);
  job.cache = path_text(checked.cache);
  job.color_config = path_text(options.color_config);
  job.existing = options.existing == compose::ExistingFiles::kOverwrite ? "overwrite" : "skip";
  job.rotten = options.rotten == store::RottenFrames::kError ? "error" : "absent";
  job.missing = options.missing == compose::MissingFrames::kHold    ? "hold"
                : options.missing == compose::MissingFrames::kBlack ? "black"
                                                                    : "error";
  job.picture = options.picture;
  job.inputs = inputs_of(*checked.sequence.plan);
  if (!job.color_config.empty()) job.inputs.push_back(job.color_config);
  job.attempts = options.attempts;
  job.least_coverage = options.least_coverage;
  job.preview = options.preview;
  job.paths = options.paths;
  job.distributed = options.distributed;
  job.frame_bytes = estimate_frame_bytes(*checked.sequence.plan, options.picture.deep);
  if (job.engine == Engine::kSlurm) {
    job.max_array_size = slurm_max_array();
    const auto& of_render = options.sbatch[static_cast<std::size_t>(schemas::FarmStage::kRender)];
    job.max_minutes = slurm_max_minutes(sbatch_partition(of_render));
    if (job.max_minutes && options.minutes.value_or(0) > *job.max_minutes) {
      throw Error::bad_input(fmt::format("a task gets {} minutes, the partition allows {}",
                                         *options.minutes, *job.max_minutes),
                             "minutes", "Give tasks fewer frames and less time");
    }
  }
  return job;
}

/// Returns the threads of a task: at most the processors of a node of the partition.
int threads_of(const SubmissionOptions& options) {
  if (options.threads > 0) return options.threads;
  int threads = std::min(available_threads(), kMaxDefaultThreads);
  if (options.engine != Engine::kSlurm) return threads;
  int most = 0;
  const auto& of_render = options.sbatch[static_cast<std::size_t>(schemas::FarmStage::kRender)];
  for (const SlurmNode& node : slurm_nodes(sbatch_partition(of_render))) {
    most = std::max(most, node.processors);
  }
  return most > 0 ? std::min(threads, most) : threads;
}

/// Adds the tasks and their resources to the job. `measured`: the first frame, if it was measured.
void add_tasks(const SubmissionOptions& options, const SubmissionCheckResult& checked,
               const std::optional<schemas::FarmAttempt::End>& measured,
               schemas::FarmJobDocument& job) {
  const std::vector<int> frames = numbers_of(checked.sequence.frames);
  if (measured) job.seconds_per_frame = measured->wall_seconds;
  std::vector<const compose::DerivedFrameData*> missing;
  for (const compose::DerivedFrameData& instant : checked.instants) {
    job.pinned.push_back(path_text(instant.file));
    if (file_exists(instant.file)) continue;
    missing.push_back(&instant);
    job.instants.push_back(
        {static_cast<int>(instant.layer), instant.tick, path_text(instant.file)});
  }
  // A task of a distributed job occupies all nodes, so one task renders all frames.
  const int per_chunk = options.chunk.value_or(
      options.distributed ? static_cast<int>(frames.size())
                          : automatic_chunk_size(frames.size(), job.seconds_per_frame));
  std::size_t longest = 1;
  for (const auto& chunk : split_into_chunks(frames, {per_chunk, options.preview_first})) {
    job.chunks.push_back({compose::format_frame_range(chunk), instants_for(chunk, missing)});
    longest = std::max(longest, chunk.size());
  }
  const ResourceRequest request{*checked.sequence.plan,    checked.sequence.frames,
                                options.picture.deep,      threads_of(options),
                                options.memory_gb,         options.minutes,
                                static_cast<int>(longest), measured};
  for (const schemas::FarmStage stage : schemas::kFarmStages) {
    job.of(stage) = estimate_resources(stage, request);
    std::optional<int>& minutes = job.of(stage).minutes;
    if (minutes && job.max_minutes) minutes = std::min(*minutes, *job.max_minutes);
    job.of(stage).options = options.sbatch[static_cast<std::size_t>(stage)];
  }
}

schemas::FarmRound first_round(const schemas::FarmJobDocument& job) {
  schemas::FarmRound round;
  for (std::size_t i = 0; i < job.instants.size(); ++i)
    round.prepare.push_back(static_cast<int>(i));
  for (std::size_t i = 0; i < job.chunks.size(); ++i) round.render.push_back(static_cast<int>(i));
  return round;
}

bool wants_measure(const SubmissionOptions& options) {
  const bool all_given = options.chunk && options.memory_gb > 0 && options.minutes;
  return options.measure && !options.distributed && options.engine != Engine::kLocal && !all_given;
}

/// Renders the first frame on this host with the resources of a task, and records the attempt as
/// stage "measure". The job's tasks keep the output file. Returns nothing if the frame existed, as
/// nothing was measured. Throws Error (bad input or failed, as the renderer reports) if the frame
/// cannot be rendered.
std::optional<schemas::FarmAttempt::End> measure_first_frame(const SubmissionOptions& options,
                                                             const SubmissionCheckResult& checked,
                                                             schemas::FarmJobDocument job,
                                                             const JobFolder& folder,
                                                             const std::stop_token& stop) {
  add_tasks(options, checked, std::nullopt, job);
  const int first = checked.sequence.frames.front().frame;
  options.on_message(fmt::format("rendering frame {} to measure it", first));
  schemas::FarmAttempt attempt;
  attempt.stage = "measure";
  attempt.node = node_name();
  attempt.process = getpid();
  attempt.frames = std::to_string(first);
  attempt.started_utc = utc_now();
  record_attempt_start(folder, attempt);
  ChildOptions child_options;
  child_options.log = attempt_log(folder, attempt);
  child_options.stop = stop;
  std::string last;
  bool rendered = true;
  child_options.line = [&](std::string_view line) {
    if (!line.starts_with("Progress: ")) last = line;
    if (line.starts_with("0 of 1 frames rendered")) rendered = false;
  };
  const ChildResult child = run_child(
      render_command(job, options.shot, 0, attempt.frames, job.existing, 1), child_options);
  const bool is_complete =
      child.exit_code == 0 || child.exit_code == static_cast<int>(ExitCode::kFellShort);
  schemas::FarmAttempt::End end;
  end.result = is_complete ? schemas::AttemptResult::kDone : schemas::AttemptResult::kFailed;
  end.exit_code = is_complete ? 0 : child.exit_code;
  end.wall_seconds = child.wall_seconds;
  end.cpu_seconds = child.cpu_seconds;
  end.peak_memory_bytes = child.peak_memory_bytes;
  end.ended_utc = utc_now();
  attempt.end = end;
  record_attempt_end(folder, attempt);
  if (is_complete) return rendered ? std::optional(end) : std::nullopt;
  const std::string what =
      fmt::format("the first frame (frame {}) cannot be rendered: {}", first, last);
  const std::string advice = "Correct the cause, or submit without measuring the first frame";
  throw child.exit_code == 2 ? Error::bad_input(what, options.shot.string(), advice)
                             : Error::failed(what, options.shot.string(), advice);
}

/// A new job folder, which is removed unless the submission is complete.
class NewFolder {
 public:
  explicit NewFolder(const std::string& output) : folder_(create_job_folder(output)) {}
  ~NewFolder() {
    std::error_code ignored;
    if (!complete_) fs::remove_all(folder_.path(), ignored);
    if (!complete_) fs::remove(folder_.path().parent_path(), ignored);  // fails if not empty
  }
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;
  const JobFolder& operator*() const { return folder_; }
  const JobFolder* operator->() const { return &folder_; }
  JobFolder release() {
    complete_ = true;
    return folder_;
  }

 private:
  JobFolder folder_;
  bool complete_ = false;
};

}  // namespace

PlannedJob plan_submission(const SubmissionOptions& options) {
  check_not_live(options);
  const SubmissionCheckResult checked = check_submission(options);
  PlannedJob planned;
  planned.job = new_job(options, checked);
  add_tasks(options, checked, std::nullopt, planned.job);
  planned.job.folder = path_text(farm_folder(options.output) / "job-NNNN");
  planned.round = first_round(planned.job);
  planned.shot_text = map_shot_paths(read_file(options.shot), options.shot.string(), options.paths);
  map_paths(planned.job, options.paths);
  return planned;
}

JobFolder write_submission(const SubmissionOptions& options, const std::stop_token& stop) {
  check_not_live(options);
  const SubmissionCheckResult checked = [&] {
    const CancellationScope cancellation(stop);
    return check_submission(options);
  }();
  schemas::FarmJobDocument job = new_job(options, checked);
  const auto live = find_live_job(options.output);
  NewFolder folder(options.output);
  job.folder = path_text(folder->path());
  // Of two simultaneous submissions the one with the lower number continues.
  if (const auto other = find_live_job(options.output, folder->path()); other && !options.after) {
    throw Error::bad_input("another job of this output is being submitted", other->path().string(),
                           "Wait for it, or submit with waiting for live jobs enabled");
  }
  if (job.engine == Engine::kSlurm) {
    // Test before anything is rendered, with resources as if no frame were measured.
    schemas::FarmJobDocument draft = job;
    add_tasks(options, checked, std::nullopt, draft);
    write_batch_scripts(*folder, draft);
    test_batch_scripts(*folder, draft);
  }
  std::optional<schemas::FarmAttempt::End> measured;
  if (wants_measure(options)) measured = measure_first_frame(options, checked, job, *folder, stop);
  add_tasks(options, checked, measured, job);
  std::vector<fs::path> derived;
  for (const compose::DerivedFrameData& instant : checked.instants) derived.push_back(instant.file);
  compose::pin_derived_data(derived, job.id);
  if (live && options.after) {
    // A relative path, which is the same on every host.
    write_file_atomically(folder->after_file(), "../" + live->path().filename().string() + "\n");
  }
  write_file_atomically(folder->shot_file(), map_shot_paths(read_file(options.shot),
                                                            options.shot.string(), options.paths));
  map_paths(job, options.paths);
  if (job.engine == Engine::kSlurm) {
    write_batch_scripts(*folder, job);
    if (live && options.after) {
      write_file_atomically(folder->path() / "start.sbatch", start_script(job, live->job().id));
      write_file_atomically(folder->path() / "start.sh", queue_start_script(job));
    }
  }
  write_round(*folder, job, first_round(job));
  write_file_atomically(folder->job_file(),
                        schemas::format_farm_job(job));  // last: the job is complete
  return folder.release();
}

}  // namespace raystage::farm
