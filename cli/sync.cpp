// SPDX-License-Identifier: Apache-2.0
// raystage sync: the timeline of a take.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>

#include "base/atomic_file.h"
#include "cli/choice_option.h"
#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/threads.h"
#include "raystage_version.h"
#include "schemas/former_names.h"
#include "store/journal_archives.h"
#include "store/processing/retime/retime_take.h"
#include "store/processing/sync/flash.h"
#include "store/processing/sync/luminance.h"
#include "store/processing/sync/node_offsets.h"
#include "store/processing/sync/resync.h"
#include "store/processing/sync/resync_report.h"

namespace raystage {
namespace {

struct Options {
  std::string take, stamps = "auto", node_offsets, flash_per = "node", report, output;
  double fps = 0, tolerance_ms = 0, longest_gap_ms = 0;
  std::optional<double> tick_at;
  RetimeMethod retime = RetimeMethod::kNearest;
  int quality = RetimeSettings{}.quality, threads = 0;
  std::vector<double> flash_window;
  bool flash = false, keep_start_up = false, json = false, quiet = false;
};

Nanoseconds from_ms(double milliseconds) {
  return static_cast<Nanoseconds>(std::llround(milliseconds * kNsPerMs));
}

void print_text(const ResyncResult& resync, const std::vector<std::string>& verdict) {
  const Timeline& timeline = resync.timeline;
  const TimelineStatistics statistics = timeline_statistics(timeline);
  const long absent = std::reduce(statistics.absent.begin(), statistics.absent.end(), 0L);
  const auto all = static_cast<double>(statistics.absent.size() * timeline.ticks.size());
  for (const std::string& sentence : verdict) fmt::print("{}\n", sentence);
  fmt::print("Rate       {:.6g} Hz\n", timeline.fps);
  fmt::print("Ticks      {}, from {:.6f} s to {:.6f} s\n", timeline.ticks.size(),
             static_cast<double>(timeline.ticks.front().time_ns) / kNsPerS,
             static_cast<double>(timeline.ticks.back().time_ns) / kNsPerS);
  fmt::print("Tolerance  {:.3f} ms\n", static_cast<double>(timeline.tolerance) / kNsPerMs);
  fmt::print("Spread     mean {:.3f} ms, median {:.3f} ms, at most {:.3f} ms\n",
             statistics.mean_spread_ns / kNsPerMs,
             static_cast<double>(statistics.median_spread) / kNsPerMs,
             static_cast<double>(statistics.max_spread) / kNsPerMs);
  fmt::print("Absent     {} of {:.0f} frames ({:.2f} %)", absent, all,
             100 * static_cast<double>(absent) / all);
  const auto nobody = std::ranges::count(timeline.ticks, 0, &FrameSelection::present);
  if (nobody > 0) fmt::print("; at {} ticks no camera has one", nobody);
  fmt::print("\n");
}

FlashOffsets find_flashes(const Take& take, const std::vector<CameraTimestamps>& cameras,
                          const ResyncSettings& settings, const Options& options,
                          std::stop_token stop) {
  const ResyncResult resync = resynchronise(cameras, settings, options.take);
  Nanoseconds begin = std::numeric_limits<Nanoseconds>::min() + 1;
  Nanoseconds end = std::numeric_limits<Nanoseconds>::max();
  if (!options.flash_window.empty()) {
    begin = from_ms(options.flash_window[0] * 1e3);
    end = from_ms(options.flash_window[1] * 1e3);
  }
  Progress progress(!options.quiet);
  const auto luminance = measure_luminance(
      take, resync.times, begin, end, [&](double done) { progress.report(done); }, stop);
  std::vector<std::vector<FlashOnset>> jumps;
  std::vector<std::string> group;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    jumps.push_back(find_flash_onsets(resync.times[c], luminance[c]));
    const bool by_node = options.flash_per == "node" && !cameras[c].node.empty();
    group.push_back(by_node ? cameras[c].node : cameras[c].id);
  }
  return offsets_from_flashes(jumps, group, options.take);
}

RetimeReport retime(const Take& take, const ResyncResult& resync, const Options& options,
                    const std::stop_token& stop) {
  RetimeSettings settings;
  settings.method = options.retime;
  settings.max_gap = from_ms(options.longest_gap_ms);
  settings.quality = options.quality;
  Progress progress(!options.quiet);
  return retime_take(
      take, resync.timeline, resync.times, settings, options.output, "raystage " RAYSTAGE_VERSION,
      [&](double done) { progress.report(done); }, stop);
}

void print_text(const RetimeReport& report, const std::string& output) {
  fmt::print("Retimed    {}: {} frames moved to their ticks, {} as they were, {} missing\n", output,
             report.moved, report.unchanged, report.missing);
  const TimelineStatistics there = timeline_statistics(read_timeline(Take(output)));
  fmt::print("Spread     there mean {:.3f} ms, at most {:.3f} ms\n",
             there.mean_spread_ns / kNsPerMs, static_cast<double>(there.max_spread) / kNsPerMs);
  if (report.moved > 0) fmt::print("Moving     {:.1f} ms a frame\n", report.ms_per_interpolated);
}

void print_json(const ResyncResult& resync, const std::optional<FlashOffsets>& flash,
                const std::optional<RetimeReport>& retimed) {
  auto json = nlohmann::ordered_json::parse(resync_report_json(resync, flash));
  if (retimed) {
    json["retimed"] = {{"interpolated", retimed->moved},
                       {"unchanged", retimed->unchanged},
                       {"missing", retimed->missing},
                       {"ms_per_interpolated", retimed->ms_per_interpolated}};
    constexpr FormerName kFormerNames[] = {{"interpolated", "moved"},
                                           {"unchanged", "as_they_were"},
                                           {"ms_per_interpolated", "ms_per_moved"}};
    add_former_names(json["retimed"], kFormerNames);
  }
  fmt::print("{}\n", json.dump(2));
}

void say_what_is_elsewhere(const Take& take) {
  int cameras = 0;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    cameras += take.archive(camera).is_remote() ? 1 : 0;
  }
  if (cameras == 0) return;
  fmt::print(
      stderr,
      "raystage sync: {} of {} archives are not here; the times are those of their journals\n",
      cameras, take.camera_count());
}

ExitCode sync(const Options& options, std::stop_token stop) {
  if (options.retime != RetimeMethod::kNearest && options.output.empty()) {
    throw Error::bad_input("frames are moved into a new take, and none is named", "--retime",
                           "Give -o NEWTAKE; TAKE itself stays as it is");
  }
  if (!options.flash_window.empty() && options.flash_window[0] >= options.flash_window[1]) {
    throw Error::bad_input("the window ends before it begins", "--flash-window",
                           "Give BEGIN before END, seconds");
  }
  if (!options.output.empty() && std::filesystem::exists(options.output)) {
    throw Error::bad_input("the folder exists already", options.output,
                           "Choose another name, or remove it");
  }
  const ThreadLimit limit(options.threads);
  const Take take(options.take, make_journal_archives(options.take));
  say_what_is_elsewhere(take);
  const std::vector<CameraTimestamps> cameras = camera_timestamps(take);
  ResyncSettings settings;
  settings.fps = options.fps;
  settings.tolerance = from_ms(options.tolerance_ms);
  settings.trust_timestamps =
      options.stamps == "exact" ||
      (options.stamps == "auto" && !has_arrival_timestamps(take.document()));
  settings.keep_start_up = options.keep_start_up;
  if (options.tick_at) settings.tick_at = from_ms(*options.tick_at * 1e3);
  settings.nominal_fps = take.document().nominal_fps;
  if (!options.node_offsets.empty()) {
    settings.offsets = read_node_offsets(options.node_offsets, cameras);
  }
  std::optional<FlashOffsets> flash;
  if (options.flash) {
    flash = find_flashes(take, cameras, settings, options, stop);
    if (stop.stop_requested()) return ExitCode::kFailed;
    add_offsets(*flash, options.flash_per == "node", cameras, settings.offsets);
  }
  const ResyncResult resync = resynchronise(cameras, settings, options.take);
  if (options.output.empty()) write_timeline(resync.timeline, take);
  if (!options.report.empty()) {
    write_file_atomically(options.report, resync_report_html(resync, flash, take.document().name));
  }
  std::optional<RetimeReport> retimed;
  if (!options.output.empty()) retimed = retime(take, resync, options, stop);
  if (options.json) {
    print_json(resync, flash, retimed);
  } else {
    print_text(resync, resync_findings(resync, flash));
    if (retimed) print_text(*retimed, options.output);
  }
  return ExitCode::kSuccess;
}

void add_retime_options(CLI::App& app, Options& options) {
  add_choice<RetimeMethod>(
      app, "--retime", options.retime,
      {{"nearest", RetimeMethod::kNearest},
       {"blend", RetimeMethod::kBlend},
       {"flow", RetimeMethod::kFlow}},
      "How frames get to their ticks' exact time in the new take: nearest (default; frames byte "
      "for byte at their own corrected times), blend (the frames before and after blended), flow "
      "(what moves between them is moved, what is hidden in one is taken from the other)");
  auto* output =
      app.add_option("-o,--output", options.output,
                     "New take with the retimed frames and the timeline (TAKE is only read)")
          ->type_name("NEWTAKE");
  app.add_option(
         "--max-gap", options.longest_gap_ms,
         "Frames further apart get nothing made between them, ms (default: 2.5 ticks, which "
         "bridges one lost frame)")
      ->check(CLI::Range(1e-6, 1e9).description(""))
      ->needs(output);
  app.add_option("--quality", options.quality, "JPEG quality of frames that are made, 1-100")
      ->capture_default_str()
      ->check(CLI::Range(1, 100).description(""))
      ->needs(output);
  add_threads_option(app, options.threads);
}

void add_options(CLI::App& app, Options& options) {
  app.add_option("TAKE", options.take, "Folder of the take")->required();
  app.add_option("--fps", options.fps,
                 "Ticks per second, Hz (default: the cameras' own rate, detected)")
      ->check(CLI::Range(1e-3, 1e6).description(""));
  app.add_option("--tolerance", options.tolerance_ms,
                 "How far a frame may lie from its tick, ms (default: half a tick); a camera "
                 "without a frame that near is absent")
      ->check(CLI::Range(1e-6, 1e9).description(""));
  app.add_option(
         "--tick-at", options.tick_at,
         "A tick falls on this time, s since the take's epoch (default: where the frames lie "
         "best)")
      ->check(CLI::Range(-1e7, 1e7).description(""));
  app.add_option("--timestamps", options.stamps,
                 "Whether stamps are exposures' own (exact) or came late (jittered), so that a "
                 "camera's rhythm says better when it exposed; auto (default): jittered where "
                 "take.json says that times mark arrivals")
      ->check(CLI::IsMember({"auto", "exact", "jittered"}).description(""));
  app.add_flag("--keep-start-up", options.keep_start_up,
               "Let ticks begin before the start-up, in which frames are lost, is over");
  auto* given =
      app.add_option("--node-offsets", options.node_offsets,
                     "JSON file {\"node\": ms}: how far each node's (or camera's) clock is "
                     "ahead, ms; taken off")
          ->option_text("FILE");
  auto* flash =
      app.add_flag("--flash", options.flash,
                   "Find clock offsets from flashes of light that all cameras see: reads pictures");
  flash->excludes(given);
  app.add_option("--flash-clock", options.flash_per,
                 "Whose clock: one offset per node (default) or camera")
      ->check(CLI::IsMember({"node", "camera"}).description(""))
      ->needs(flash);
  app.add_option("--flash-window", options.flash_window,
                 "Where to look for flashes, s since the take's epoch (default: everywhere)")
      ->expected(2)
      ->check(CLI::Range(-1e9, 1e9).description(""))
      ->option_text("BEGIN END")
      ->needs(flash);
  app.add_option("--report", options.report, "Write an HTML page with charts and the verdict")
      ->option_text("FILE.html");
  add_retime_options(app, options);
  app.add_flag("--json", options.json, "Print everything found as JSON");
  app.add_flag("-q,--quiet", options.quiet, "No progress on stderr");
}

}  // namespace
}  // namespace raystage

int main(int argc, char** argv) {
  using namespace raystage;
  CLI::App app(
      "Resynchronises the free-running cameras of a take: ticks at a constant rate, each with the\n"
      "nearest frame of every camera. Finds each camera's period and phase, clock steps and\n"
      "lost frames. Written to TAKE/timeline.zst, or with -o into a new take; the archives stay "
      "as\n"
      "they are.",
      "raystage sync");
  Options options;
  add_options(app, options);
  return parse_and_run(app, argc, argv, "sync",
                       [&](std::stop_token stop) { return sync(options, stop); }, OnSignal::kAbort,
                       {{"--flash-per", "--flash-clock"},
                        {"--longest-gap", "--max-gap"},
                        {"--stamps", "--timestamps"}});
}
