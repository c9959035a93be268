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

#include "compose/frame_range.h"
#include "compose/preparation.h"
#include "farm/attempts.h"
#include "farm/child_process.h"
#include "farm/job_plan.h"
#include "farm/node.h"
#include "farm/render_command.h"
#include "farm/resources.h"
#include "farm/rounds.h"
#include "farm/slurm_queue.h"
#include "farm/slurm_scripts.h"
#include "farm/status.h"
#include "farm/verification.h"
#include "raystage_version.h"
#include "render/view/simd_level.h"
#include "schemas/atomic_file.h"
#include "schemas/resources.h"

namespace raystage::farm {
namespace {

namespace fs = std::filesystem;
using Engine = FarmJobDocument::Engine;

constexpr int kMostThreadsByDefault = 8;

std::string user_name() {
  const passwd* user = getpwuid(geteuid());
  return user == nullptr ? std::to_string(geteuid()) : user->pw_name;
}

/// "shot-1a2b3c4d", of characters that file names and Slurm take.
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

void check_sbatch_options(const SubmissionOptions& options) {
  for (const auto& of_stage : options.sbatch) {
    for (const std::string& option : of_stage) {
      const bool is_clean =
          std::ranges::none_of(option, [](char c) { return static_cast<unsigned char>(c) < ' '; });
      if (is_clean && option.starts_with("-")) continue;
      throw Error::bad_input("found \"" + option + "\", allowed: one option of sbatch", "sbatch",
                             "Write for example --partition=fast");
    }
  }
}

/// A task that is alone chooses for itself, and may choose otherwise than the next.
void check_methods(const ShotPlan& plan, const fs::path& shot) {
  for (std::size_t i = 0; i < plan.layers(); ++i) {
    if (plan.light_field(i) == nullptr) continue;
    if (plan.light_field(i)->reconstruction().method != "auto") continue;
    throw Error::bad_input(
        "method auto chooses anew in every task, so tasks could differ",
        fmt::format("{}#/layers/{}/method", shot.string(), i),
        "Render one frame locally and write the method that its log names into the shot");
  }
}

/// Whether data can be stored in the folders of all takes that derive some.
bool are_takes_writable(const std::vector<DerivedInstant>& instants) {
  return std::ranges::all_of(instants, [](const DerivedInstant& instant) {
    fs::path folder = instant.file.parent_path();
    std::error_code ignored;
    while (!fs::exists(folder, ignored) && folder.has_relative_path())
      folder = folder.parent_path();
    return access(folder.c_str(), W_OK) == 0;
  });
}

SequenceOptions sequence_options(const SubmissionOptions& options, const fs::path& cache) {
  SequenceOptions sequence;
  sequence.output = options.output;
  sequence.frames = options.frames;
  sequence.existing = options.existing;
  sequence.missing = options.missing;
  if (options.picture.fill == "none") sequence.fill = HoleFill::kNone;
  if (options.picture.fill == "push-pull") sequence.fill = HoleFill::kPushPull;
  sequence.layout = options.picture.layout;
  sequence.color_config = options.color_config;
  if (options.picture.coverage) sequence.aovs = {"lf.cameras", "lf.nearest"};
  if (options.picture.confidence) sequence.aovs.emplace_back("lf.confidence");
  sequence.deep = options.picture.deep;
  sequence.cache_folder = cache;
  sequence.say = options.say;
  return sequence;
}

/// Everything that is checked before anything is written, and what it found.
struct Checked {
  CheckedSequence sequence;
  std::vector<DerivedInstant> instants;
  fs::path cache;
};

Checked check(const SubmissionOptions& options) {
  check_sbatch_options(options);
  Checked checked{
      check_sequence(options.shot, sequence_options(options, options.cache)), {}, options.cache};
  check_methods(*checked.sequence.plan, options.shot);
  checked.instants = derived_instants(*checked.sequence.plan, checked.sequence.frames);
  if (checked.cache.empty() && !are_takes_writable(checked.instants)) {
    checked.cache = fs::absolute(farm_folder(options.output) / "cache");
    options.say("a take is read-only: derived data goes to " + checked.cache.string());
    checked.sequence = check_sequence(options.shot, sequence_options(options, checked.cache));
    checked.instants = derived_instants(*checked.sequence.plan, checked.sequence.frames);
  }
  return checked;
}

void check_not_live(const SubmissionOptions& options) {
  if (options.after && options.engine != Engine::kSlurm) {
    throw Error::bad_input("only Slurm's jobs can wait for others", "",
                           "Leave --after out, or submit once the other job is over");
  }
  const auto live = live_job(options.output);
  if (!live || options.after) return;
  std::error_code ignored;
  if (!fs::exists(live->job_file(), ignored)) {
    throw Error::bad_input("a job of this output is being submitted", live->path().string(),
                           "Wait for it; if its submission was killed, delete the folder");
  }
  throw Error::bad_input("a job of this output is not over: " + live->job().id,
                         live->path().string(),
                         "Wait for it (raystage farm status), cancel it, or queue this one behind "
                         "it with --after");
}

std::vector<int> numbers_of(const std::vector<PlannedFrame>& frames) {
  std::vector<int> numbers;
  for (const PlannedFrame& frame : frames) numbers.push_back(frame.frame);
  return numbers;
}

/// The indices of instants that each frame waits for.
std::vector<int> instants_for(const std::vector<int>& frames,
                              const std::vector<const DerivedInstant*>& missing) {
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

/// What a node must see: takes and meshes; plates may be thousands of files.
std::vector<std::string> inputs_of(const ShotPlan& plan) {
  std::set<std::string> inputs;
  for (std::size_t i = 0; i < plan.layers(); ++i) {
    if (plan.light_field(i) != nullptr) {
      inputs.insert(path_text(plan.light_field(i)->take().folder() / "take.json"));
    }
  }
  return {inputs.begin(), inputs.end()};
}

FarmJobDocument new_job(const SubmissionOptions& options, const Checked& checked) {
  FarmJobDocument job;
  job.id = new_job_id(options.output);
  job.engine = options.engine;
  job.submitted_utc = utc_now();
  job.submitted_by = user_name();
  job.submitted_on = node_name();
  job.program_version = RAYSTAGE_VERSION;
  // In a container other libraries may be installed: the first task says which.
  if (options.wrap.empty()) job.build = build_id();
  const SimdLevel best = best_simd_level();
  job.simd =
      options.simd.empty() ? simd_level_name(std::min(best, SimdLevel::kAvx2)) : options.simd;
  const mode_t mask = umask(0);
  umask(mask);
  job.umask = static_cast<int>(mask);
  job.wrap = options.wrap;
  job.program = options.program.empty()
                    ? mapped(sibling_program("raystage").string(), options.paths)
                    : options.program;
  job.shot = path_text(options.shot);
  job.shot_folder = path_text(fs::absolute(options.shot).parent_path());
  job.output = path_text(options.output);
  job.cache = path_text(checked.cache);
  job.color_config = path_text(options.color_config);
  job.existing = options.existing == ExistingFiles::kOverwrite ? "overwrite" : "skip";
  job.missing = options.missing == MissingFrames::kHold    ? "hold"
                : options.missing == MissingFrames::kBlack ? "black"
                                                           : "error";
  job.picture = options.picture;
  job.inputs = inputs_of(*checked.sequence.plan);
  if (!job.color_config.empty()) job.inputs.push_back(job.color_config);
  job.attempts = options.attempts;
  job.preview = options.preview;
  job.frame_bytes = frame_room(*checked.sequence.plan, options.picture.deep);
  if (job.engine == Engine::kSlurm) job.max_array = slurm_max_array();
  return job;
}

/// Tasks, and what each may use, once the frame is measured (or not).
void add_tasks(const SubmissionOptions& options, const Checked& checked,
               const std::optional<FarmAttempt::End>& measured, FarmJobDocument& job) {
  const std::vector<int> frames = numbers_of(checked.sequence.frames);
  if (measured) job.seconds_per_frame = measured->wall_seconds;
  std::vector<const DerivedInstant*> missing;
  std::error_code ignored;
  for (const DerivedInstant& instant : checked.instants) {
    job.pinned.push_back(path_text(instant.file));
    if (fs::exists(instant.file, ignored)) continue;
    missing.push_back(&instant);
    job.instants.push_back(
        {static_cast<int>(instant.layer), instant.tick, path_text(instant.file)});
  }
  const int per_chunk =
      options.chunk.value_or(automatic_chunk(frames.size(), job.seconds_per_frame));
  std::size_t longest = 1;
  for (const auto& chunk : cut_into_chunks(frames, {per_chunk, options.preview_first})) {
    job.chunks.push_back({format_frame_range(chunk), instants_for(chunk, missing)});
    longest = std::max(longest, chunk.size());
  }
  const ResourceRequest request{
      *checked.sequence.plan,
      checked.sequence.frames,
      options.picture.deep,
      options.threads > 0 ? options.threads : std::min(available_threads(), kMostThreadsByDefault),
      options.memory_gb,
      options.minutes,
      static_cast<int>(longest),
      measured};
  for (const FarmStage stage : kFarmStages) {
    job.of(stage) = resources_for(stage, request);
    job.of(stage).options = options.sbatch[static_cast<std::size_t>(stage)];
  }
}

FarmRound first_round(const FarmJobDocument& job) {
  FarmRound round;
  for (std::size_t i = 0; i < job.instants.size(); ++i)
    round.prepare.push_back(static_cast<int>(i));
  for (std::size_t i = 0; i < job.chunks.size(); ++i) round.render.push_back(static_cast<int>(i));
  return round;
}

bool wants_measure(const SubmissionOptions& options) {
  const bool all_given = options.chunk && options.memory_gb > 0 && options.minutes;
  return options.measure && options.engine != Engine::kLocal && !all_given;
}

/// Renders the first frame here, into its place; the job's tasks keep it.
std::optional<FarmAttempt::End> measure(const SubmissionOptions& options, const Checked& checked,
                                        FarmJobDocument job, const JobFolder& folder,
                                        const std::stop_token& stop) {
  add_tasks(options, checked, std::nullopt, job);
  const int first = checked.sequence.frames.front().frame;
  options.say(fmt::format("rendering frame {} to measure it", first));
  FarmAttempt attempt;
  attempt.stage = "measure";
  attempt.node = node_name();
  attempt.process = getpid();
  attempt.frames = std::to_string(first);
  attempt.started_utc = utc_now();
  record_start(folder, attempt);
  ChildOptions child_options;
  child_options.log = attempt_log(folder, attempt);
  child_options.stop = stop;
  std::string last;
  bool rendered = true;
  child_options.line = [&](std::string_view line) {
    if (!line.starts_with("Progress: ")) last = line;
    if (line.starts_with("0 of 1 frames rendered")) rendered = false;
  };
  const ChildResult child =
      run_child(render_command(job, options.shot, attempt.frames, job.existing, 1), child_options);
  FarmAttempt::End end;
  end.result = child.exit_code == 0 ? AttemptResult::kDone : AttemptResult::kFailed;
  end.exit_code = child.exit_code;
  end.wall_seconds = child.wall_seconds;
  end.cpu_seconds = child.cpu_seconds;
  end.peak_memory_bytes = child.peak_memory_bytes;
  end.ended_utc = utc_now();
  attempt.end = end;
  record_end(folder, attempt);
  // A frame that was there already measures nothing.
  if (child.exit_code == 0) return rendered ? std::optional(end) : std::nullopt;
  const std::string what =
      fmt::format("the first frame (frame {}) cannot be rendered: {}", first, last);
  const std::string mend = "Mend what it says, or submit without measuring";
  throw child.exit_code == 2 ? Error::bad_input(what, options.shot.string(), mend)
                             : Error::failed(what, options.shot.string(), mend);
}

/// A job folder that goes again unless the submission is complete.
class NewFolder {
 public:
  explicit NewFolder(const std::string& output) : folder_(create_job_folder(output)) {}
  ~NewFolder() {
    std::error_code ignored;
    if (!complete_) fs::remove_all(folder_.path(), ignored);
    if (!complete_) fs::remove(folder_.path().parent_path(), ignored);  // only where it is empty
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
  const Checked checked = check(options);
  PlannedJob planned;
  planned.job = new_job(options, checked);
  add_tasks(options, checked, std::nullopt, planned.job);
  planned.job.folder = path_text(farm_folder(options.output) / "job-NNNN");
  planned.round = first_round(planned.job);
  planned.shot_text =
      map_paths_of_shot(read_file(options.shot), options.shot.string(), options.paths);
  map_paths(planned.job, options.paths);
  return planned;
}

JobFolder write_submission(const SubmissionOptions& options, const std::stop_token& stop) {
  check_not_live(options);
  const Checked checked = check(options);
  FarmJobDocument job = new_job(options, checked);
  const auto live = live_job(options.output);
  NewFolder folder(options.output);
  job.folder = path_text(folder->path());
  // Of two submissions at a time the one with the lower number stays.
  if (const auto other = live_job(options.output, folder->path()); other && !options.after) {
    throw Error::bad_input("another job of this output is being submitted", other->path().string(),
                           "Wait for it, or queue this one behind it with --after");
  }
  std::optional<FarmAttempt::End> measured;
  if (wants_measure(options)) measured = measure(options, checked, job, *folder, stop);
  add_tasks(options, checked, measured, job);
  std::vector<fs::path> derived;
  for (const DerivedInstant& instant : checked.instants) derived.push_back(instant.file);
  pin_derived(derived, job.id);
  if (live && options.after) {
    // By its place next to this folder, which is the same on every host.
    write_file_atomically(folder->after_file(), "../" + live->path().filename().string() + "\n");
  }
  write_file_atomically(
      folder->shot_file(),
      map_paths_of_shot(read_file(options.shot), options.shot.string(), options.paths));
  map_paths(job, options.paths);
  if (job.engine == Engine::kSlurm) {
    write_batch_scripts(*folder, job);
    if (live && options.after) {
      write_file_atomically(folder->path() / "start.sbatch", start_script(job));
      write_file_atomically(folder->path() / "start.sh", queue_start_script(job));
    }
  }
  write_round(*folder, job, first_round(job));
  write_file_atomically(folder->job_file(), format_farm_job(job));  // last: now it is a job
  return folder.release();
}

void queue_job(const JobFolder& folder) {
  const FarmJobDocument job = folder.job();
  try {
    std::error_code ignored;
    run_queue_script(folder, fs::exists(folder.after_file(), ignored) ? "start.sh" : "round-1.sh");
  } catch (const Error& error) {
    try {
      slurm_cancel(job);      // what was accepted before
    } catch (const Error&) {  // the first error says enough
    }
    FarmEnd end;
    end.state = FarmEnd::State::kFailed;
    end.reason = error.what();
    end.frames = static_cast<int>(frames_of(job).size());
    end_job(folder, job, end);
    throw;
  }
}

FarmRound write_retry(const JobFolder& folder, const std::optional<std::vector<int>>& frames) {
  const FarmJobDocument job = folder.job();
  const JobStatus status = job_status(folder);
  if (status.is_live()) {
    throw Error::bad_input(
        "the job is not over: it is " + std::string(job_state_name(status.state)),
        folder.path().string(), "Wait for it, or cancel it first");
  }
  std::vector<int> wanted;
  if (frames) {
    wanted = *frames;
  } else if (const auto end = folder.end(); end && !end->missing_frames.empty()) {
    wanted = parse_frame_range(end->missing_frames);
  } else {
    for (const TaskStatus& task : status.tasks) {
      if (task.stage != "render" || task.state == TaskState::kDone) continue;
      const auto own = parse_frame_range(job.chunks[static_cast<std::size_t>(task.index)].frames);
      wanted.insert(wanted.end(), own.begin(), own.end());
    }
    std::ranges::sort(wanted);
  }
  FarmRound round;
  round.round = static_cast<int>(folder.rounds().size()) + 1;
  round.render = chunks_with(job, wanted);
  if (round.render.empty()) {
    throw Error::bad_input("there is nothing to try again: no task has one of these frames",
                           folder.path().string(), "Name frames of the job");
  }
  std::error_code ignored;
  std::set<int> prepare;
  for (const int chunk : round.render) {
    for (const int i : job.chunks[static_cast<std::size_t>(chunk)].instants) {
      if (!fs::exists(job.instants[static_cast<std::size_t>(i)].file, ignored)) prepare.insert(i);
    }
  }
  round.prepare.assign(prepare.begin(), prepare.end());
  round.fresh = true;
  // A node that was at fault may have been mended since.
  for (const auto& [node, reason] : folder.excluded_nodes()) {
    fs::remove(folder.excluded() / node, ignored);
  }
  folder.reopen();
  write_round(folder, job, round);
  return round;
}

}  // namespace raystage::farm
