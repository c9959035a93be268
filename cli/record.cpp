// SPDX-License-Identifier: Apache-2.0
// raystage record: records the cameras of one ingest node.
#include <fmt/format.h>
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "base/atomic_file.h"
#include "base/resources.h"
#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/printing.h"
#include "cli/record_status.h"
#include "cli/record_takes.h"
#include "cli/take_event.h"
#include "cli/threads.h"
#include "ingest/record/memory_ceiling.h"
#include "ingest/record/open_cameras.h"
#include "ingest/record/record_setup.h"
#include "ingest/record/recording_memory_plan.h"
#include "ingest/sources/open_frame_source.h"
#include "raystage_version.h"

namespace raystage::cli {
namespace {

struct Options {
  std::filesystem::path config, take, mirror;
  std::string node, start_at, status = "auto";
  double duration = 0, memory_mb = 0, memory_ceiling_mb = 0;
  int threads = 0;
  bool hold = false, resume = false, allow_filters_with_files = false;
};

void declare(CommandLine& command, Options& options) {
  command.option("CONFIG", options.config, "Configuration of the recording (record.json)")
      .required();
  command.option("-o,--output TAKE", options.take, "Folder of the take, new without --resume")
      .required();
  command.option("--node NAME", options.node,
                 "Name of this node (default: from the configuration, else the host's name)");
  command
      .option("--duration S", options.duration,
              "Stop after this many seconds (default: at Ctrl-C, SIGTERM or the sources' end)")
      .range(0.001, 1e7);
  command.option("--start-at UTC", options.start_at,
                 "Start of the recording, UTC, e.g. 2026-01-01T12:00:00Z; nodes with the same time "
                 "start together (default: now)");
  command.flag("--buffer-in-memory", options.hold,
               "Keep all frames in memory and write them at the end; reports at the start how long "
               "memory lasts");
  command
      .option("--memory MB", options.memory_mb,
              "Memory for all frames of all cameras, MB = 10^6 bytes (default: from the "
              "configuration, else 1024); other memory is reported at the start")
      .range(1.0, 1e8);
  command
      .option(
          "--memory-ceiling MB", options.memory_ceiling_mb,
          "Memory that the whole process may take, MB = 10^6 bytes: before it is reached frames "
          "are dropped and recorded as dropped (default: from the configuration, else none); a "
          "limit of the control group lowers it")
      .range(1.0, 1e8);
  command.option("--mirror FOLDER", options.mirror,
                 "Existing folder, best on another disk, in which a second copy of the take is "
                 "recorded, FOLDER/TAKE (default: from the configuration, else none)");
  command.flag("--resume", options.resume, "Continue a take after a crash or a stop");
  command
      .option("--status", options.status,
              "auto = an updated line on stderr, or one every 10 s if no terminal is attached; "
              "json = a line of JSON per second on stdout; none (default: auto)")
      .one_of({"auto", "json", "none"});
  command
      .flag(
          "-q,--quiet", [&] { options.status = "none"; }, "No progress: as --status none")
      .excludes("--status");
  command.flag(
      "--allow-filters-with-files", options.allow_filters_with_files,
      "Let FFmpeg's filters open files and load libraries; only for configurations that you "
      "trust");
  add_threads_option(command, options.threads);
  command.footer(
      "Exit codes: 0 every received frame is stored; 1 failed, or frames are unaccounted for;\n"
      "2 bad usage or input; 3 frames were dropped, or a camera was lost or sent none (see TAKE);\n"
      "4 every received frame is stored, but only in one of two copies (--mirror).\n"
      "CONFIG names each camera and its source, \"ffmpeg\", \"aravis\" or \"simulated\":\n"
      "  {\"schema\": \"raystage/record/1\", \"name\": \"take one\", \"memory_mb\": 4000,\n"
      "   \"when_full\": \"drop_newest\" (default) or \"drop_oldest\": frame to drop when memory "
      "is full,\n"
      "   \"when_lost\": \"continue\" (default), \"reconnect\" or \"stop\": action when a camera "
      "is lost,\n"
      "   \"cameras\": [{\"id\": \"r0c0\", \"ffmpeg\": {\"url\": \"v4l2:/dev/video0\"}}]}\n"
      "All settings: docs/recording.md and docs/formats/documents.md.");
}

/// Prints the status of a recording.
class StatusPrinter {
 public:
  explicit StatusPrinter(const std::string& style)
      : json_(style == "json"), none_(style == "none"), terminal_(isatty(STDERR_FILENO) == 1) {}

  void show(const ingest::RecorderStatus& status) {
    constexpr double kPlainEvery = 10;  // seconds
    if (none_) return;
    if (json_) {
      print(status_json(status) + "\n");
      std::fflush(stdout);
    } else if (terminal_) {
      std::fputs(("\r\033[K" + printable_in_line(status_line(status))).c_str(), stderr);
      open_ = true;
    } else if (status.seconds >= next_plain_) {
      print_error("{}\n", status_line(status));
      next_plain_ = status.seconds + kPlainEvery;
    }
    std::fflush(stderr);
  }
  /// Prints an alarm, whatever the style, if a copy of the take was stopped or refuses frames: at
  /// once, and then from time to time.
  void alarm(const ingest::RecorderStatus& status) {
    constexpr double kEvery = 10;  // seconds
    std::string text;
    for (const ingest::RecordingCopies::Status& copy : status.copies) {
      if (!copy.stop_reason.empty()) {
        text += fmt::format("raystage record: ONLY ONE COPY IS RECORDED, {} was stopped: {}\n",
                            copy.folder.string(), copy.stop_reason);
      } else if (!copy.write_error.empty()) {
        text += fmt::format("raystage record: {} refuses frames, which wait in memory: {}\n",
                            copy.folder.string(), copy.write_error);
      }
    }
    const bool is_new = text != last_alarm_;
    last_alarm_ = text;
    if (text.empty() || (!is_new && status.seconds < next_alarm_)) return;
    next_alarm_ = status.seconds + kEvery;
    finish();
    print(stderr, text);
  }
  void finish() {
    if (open_) std::fputc('\n', stderr);
    open_ = false;
  }

 private:
  bool json_, none_, terminal_, open_ = false;
  double next_plain_ = 0, next_alarm_ = 0;
  std::string last_alarm_;
};

Nanoseconds whole_second(Nanoseconds utc) {
  return utc / kNanosecondsPerSecond * kNanosecondsPerSecond;
}

/// Returns the rig that states the sizes of the cameras; none if they become what the sources have.
std::optional<schemas::RigDocument> known_rig(const Options& options,
                                              const schemas::RecordConfig& config) {
  if (options.resume) return schemas::read_rig(options.take / "rig.json");
  if (!config.rig.empty()) return schemas::read_rig(options.config.parent_path() / config.rig);
  return std::nullopt;
}

/// Why cameras could not be opened, by id.
using OpeningFailures = std::map<std::string, std::exception_ptr>;

/// Opens the simulated cameras. While these sources exist, opening them again allocates little. It
/// is done before a ceiling holds, because Embree may hang when an allocation fails.
std::vector<std::unique_ptr<ingest::FrameSource>> open_simulated_cameras(
    const schemas::RecordConfig& config, const ingest::OpenFrameSource& open,
    OpeningFailures& failures) {
  std::vector<std::unique_ptr<ingest::FrameSource>> sources;
  for (const schemas::RecordConfig::Camera& camera : config.cameras) {
    if (!std::holds_alternative<schemas::RecordConfig::SimulatedSource>(camera.source)) continue;
    try {
      sources.push_back(open(camera));
    } catch (const std::exception&) {
      failures[camera.id] = std::current_exception();
    }
  }
  return sources;
}

/// Holds a ceiling of memory, if there is one, until the recorder does: what a camera sends may
/// make a library take any amount. Ceilings that are too low are refused later, when what cameras
/// need is known.
void hold_ceiling(const schemas::RecordConfig& config, std::optional<std::size_t> ceiling,
                  ingest::MemoryBudget& no_frames, std::optional<ingest::MemoryCeiling>& limited) {
  constexpr std::size_t kLeast = 256'000'000;
  const bool all_survive = std::ranges::none_of(config.cameras, [](const auto& camera) {
    return std::holds_alternative<schemas::RecordConfig::AravisSource>(camera.source);
  });
  if (ceiling) limited.emplace(std::max(*ceiling, kLeast), no_frames, all_survive);
}

/// An alarm, whatever the options say of progress.
void report_absent(const std::vector<ingest::RecorderCamera>& cameras) {
  for (const ingest::RecorderCamera& camera : cameras) {
    if (camera.absence.empty()) continue;
    print_error(
        "raystage record: camera \"{}\" is ABSENT, the others are recorded: {}\n"
        "It is tried again until it comes.\n",
        camera.id, camera.absence);
  }
}

/// Throws Error if there is no take. Called before cameras are opened, which can take long.
void check_take_exists(const std::filesystem::path& take) {
  if (file_exists(take / "take.json")) return;
  throw Error::bad_input(
      "there is no take to resume", take.string(),
      "Omit --resume to begin a new take, or use the folder of the take to resume");
}

/// Rejects a start time in the past, except for a node that starts up to a minute late.
void check_start(Nanoseconds start, std::optional<double> duration_s) {
  constexpr double kALittle = 60;  // seconds
  const double late = static_cast<double>(ingest::host_utc_now() - start) / 1e9;
  if (late <= kALittle && (!duration_s || late < *duration_s)) return;
  throw Error::bad_input(fmt::format("the time was {:.0f} s ago", late), "--start-at",
                         "Use a future time, UTC; without it recording starts at once");
}

/// Reports the time to the start, called after the sources are open, which may take long.
void say_when_it_starts(Nanoseconds start, bool given) {
  const double ahead = static_cast<double>(start - ingest::host_utc_now()) / 1e9;
  if (given && ahead < 0) {
    print_error("raystage record: --start-at was {:.1f} s ago: the frames since are missing\n",
                -ahead);
  } else if (ahead > 0) {
    print_error("Recording starts at {}, in {}\n", format_utc(start), format_duration(ahead));
  }
}

/// Prints the memory plan for this machine, which had `free_before` bytes when the program began.
void say_what_memory_it_takes(const ingest::RecordingMemoryPlan& plan, std::size_t free_before) {
  print_error("{}\n", ingest::format_memory_plan(plan));
  const std::string warning = ingest::memory_warning(plan, free_before);
  if (!warning.empty()) print_error("raystage record: {}\n", warning);
}

/// Prints how long the memory lasts. `rate`: bytes per second of all cameras, if it could be
/// measured; `absent`: how many of them are absent.
void say_how_long_memory_lasts(std::size_t bytes, std::optional<double> rate,
                               std::ptrdiff_t absent) {
  const double memory = static_cast<double>(bytes);
  const std::string text =
      rate && *rate > 0
          ? fmt::format("{:.0f} MB of memory hold {} at {:.1f} MB/s{}\n", memory / 1e6,
                        format_duration(memory / *rate), *rate / 1e6,
                        absent == 0
                            ? ""
                            : fmt::format(", of which {} absent cameras were given the mean "
                                          "of the others",
                                          absent))
          : fmt::format("The duration of {:.0f} MB of memory is unknown until {}\n", memory / 1e6,
                        rate ? "frames arrive" : "files and pipes are read");
  print(stderr, text);
}

/// Returns the exit code of a recording that came to its end.
ExitCode code_of(const schemas::RecordingDocument::Session& session) {
  if (!session.audit || !session.audit->holds) return ExitCode::kFailed;
  bool is_complete = true;
  for (const schemas::RecordingDocument::Camera& camera : session.cameras) {
    const bool lost = std::ranges::any_of(
        camera.events, [](const auto& event) { return event.what.starts_with("lost"); });
    is_complete = is_complete && camera.arrived > 0 && camera.dropped.empty() &&
                  camera.skipped_by_source == 0 && !lost;
  }
  if (!is_complete) return ExitCode::kSomeFramesFailed;
  const bool all_copies =
      std::ranges::all_of(session.copies, &schemas::RecordingDocument::Copy::complete);
  return all_copies ? ExitCode::kSuccess : ExitCode::kFellShort;
}

ExitCode record(const Options& options, const std::stop_token& stop) {
  if (options.resume) check_take_exists(options.take);
  schemas::RecordConfig config = schemas::read_record_config(options.config);
  if (options.hold) config.hold = true;
  if (options.memory_mb > 0) config.memory_mb = options.memory_mb;
  const std::string node = !options.node.empty()  ? options.node
                           : !config.node.empty() ? config.node
                                                  : host_name();
  ingest::RecorderOptions settings = ingest::make_recorder_options(config);
  if (options.memory_ceiling_mb > 0) config.memory_ceiling_mb = options.memory_ceiling_mb;
  if (config.memory_ceiling_mb) {
    constexpr double kBytesPerMb = 1e6;
    const auto ceiling = static_cast<std::size_t>(*config.memory_ceiling_mb * kBytesPerMb);
    settings.memory_ceiling = std::min(ceiling, control_group_memory().value_or(ceiling));
  }
  ingest::check_recording_memory(settings.memory_bytes, available_memory());
  const std::size_t free_before = free_memory();
  settings.threads = thread_count(options.threads);
  if (!options.start_at.empty()) settings.start_utc = parse_utc(options.start_at);
  if (options.duration > 0) settings.duration_s = options.duration;
  if (settings.start_utc) check_start(*settings.start_utc, settings.duration_s);

  const std::filesystem::path folder = options.config.parent_path();
  std::filesystem::path mirror_parent = options.mirror;
  if (mirror_parent.empty() && !config.mirror.empty()) mirror_parent = folder / config.mirror;
  const std::filesystem::path mirror_folder = mirror_of(options.take, mirror_parent);
  const auto check_stop = [&] {  // opening takes long
    if (!stop.stop_requested()) return;
    throw Error::failed("stopped before the recording began", options.take.string(),
                        "Start it again; nothing was recorded");
  };
  if (options.status != "none") {
    print_error("raystage record: opening {} cameras\n", config.cameras.size());
  }
  const std::optional<schemas::RigDocument> rig = known_rig(options, config);
  const auto failures = std::make_shared<OpeningFailures>();
  const ingest::OpenFrameSource open_source =
      [folder, permissions = ingest::SourcePermissions{options.allow_filters_with_files},
       failures](const schemas::RecordConfig::Camera& camera) {
        const auto failure = failures->find(camera.id);
        if (failure != failures->end()) std::rethrow_exception(failure->second);
        return ingest::open_frame_source(camera, folder, permissions);
      };
  std::vector<std::unique_ptr<ingest::FrameSource>> simulated;
  if (settings.memory_ceiling) {
    simulated = open_simulated_cameras(config, open_source, *failures);
    check_stop();
  }
  ingest::MemoryBudget no_frames(0);
  std::optional<ingest::MemoryCeiling> ceiling_before_recording;
  hold_ceiling(config, settings.memory_ceiling, no_frames, ceiling_before_recording);
  auto cameras = ingest::open_cameras(config, open_source, rig ? &*rig : nullptr);
  simulated.clear();
  report_absent(cameras);
  // Measuring starts a thread for each camera at once, for which the limit may leave no stacks.
  if (config.hold) ceiling_before_recording.reset();
  constexpr double kMeasure = 2;  // seconds
  const auto absent = std::ranges::count_if(
      cameras, [](const ingest::RecorderCamera& camera) { return !camera.absence.empty(); });
  const auto rate = config.hold ? ingest::measure_data_rate(cameras, settings.jpeg, kMeasure)
                                : std::optional<double>();
  check_stop();
  const Nanoseconds epoch = whole_second(settings.start_utc.value_or(ingest::host_utc_now()));
  const TakeSetup setup{
      options.resume,
      folder,
      config,
      cameras,
      node,
      settings.start_utc,
      settings.duration_s,
      ingest::make_take_document(config, cameras, node, epoch, "raystage " RAYSTAGE_VERSION)};
  ingest::RecordingTake take = open_take(setup, options.take, mirror_folder);
  std::optional<ingest::RecordingTake> mirror = open_mirror(setup, mirror_folder, take);
  const ingest::RecordingMemoryPlan plan = ingest::plan_recording_memory(settings, cameras);
  if (settings.memory_ceiling) ingest::check_memory_ceiling(plan, *settings.memory_ceiling);
  ingest::Recorder recorder(settings, std::move(cameras), take, "raystage " RAYSTAGE_VERSION,
                            mirror ? &*mirror : nullptr);
  say_what_memory_it_takes(plan, free_before);
  say_when_it_starts(std::max(settings.start_utc.value_or(0), take.document().epoch_utc),
                     settings.start_utc.has_value());
  if (config.hold) say_how_long_memory_lasts(recorder.memory_for_frames(), rate, absent);
  StatusPrinter printer(options.status);
  Progress writing(config.hold && options.status == "auto");
  ceiling_before_recording.reset();
  const schemas::RecordingDocument::Session session = recorder.run(
      stop,
      [&](const ingest::RecorderStatus& status) {
        printer.alarm(status);
        printer.show(status);
      },
      [&](double done) {
        printer.finish();
        writing.report(done);
      });
  printer.finish();
  print(options.status == "json" ? stderr : stdout,
        format_line("{}: {}; ", options.take.string(), session.stop_reason) +
            format_session_summary(session));

  const ExitCode code = code_of(session);
  const auto event =
      record_event(options.take, "capture", options.resume ? "record --resume" : "record",
                   session.stop_reason, outcome_of(code));
  if (event && !mirror_folder.empty()) record_made_event(mirror_folder, *event);
  return code;
}

}  // namespace
}  // namespace raystage::cli

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  // Frames are allocated by the cameras' threads and freed by others. With an arena per thread the
  // C library keeps much freed memory: half of what the frames may take.
  mallopt(M_ARENA_MAX, 1);
  CommandLine command("Records the cameras of one ingest node into a take.", "raystage record");
  Options options;
  declare(command, options);
  return parse_and_run(command, argc, argv, "record",
                       [&](const std::stop_token& stop) { return record(options, stop); },
                       OnSignal::kEnd, {{"--hold", "--buffer-in-memory"}});
}
