// SPDX-License-Identifier: Apache-2.0
// raystage sync: makes the timeline of a take, and optionally a retimed take.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>

#include "base/atomic_file.h"
#include "base/frame_rate.h"
#include "base/number_text.h"
#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/depth_range_hint.h"
#include "cli/follow_links_option.h"
#include "cli/printing.h"
#include "cli/shutter_text.h"
#include "cli/take_event.h"
#include "cli/threads.h"
#include "raystage_version.h"
#include "rig/line_time_check.h"
#include "rig/row_times.h"
#include "schemas/former_names.h"
#include "schemas/json_text.h"
#include "store/bag_payload.h"
#include "store/journal_archives.h"
#include "store/processing/retime/retime_take.h"
#include "store/processing/sync/flash.h"
#include "store/processing/sync/luminance.h"
#include "store/processing/sync/node_offsets.h"
#include "store/processing/sync/resync.h"
#include "store/processing/sync/resync_report.h"
#include "store/rotten_frame.h"

namespace raystage::cli {
namespace {

struct Options {
  std::string take, fps, stamps = "auto", node_offsets, flash_per = "node", report, output;
  double tolerance_ms = 0, longest_gap_ms = 0;
  std::optional<double> tick_at;
  store::RetimeMethod retime = store::RetimeMethod::kNearest;
  store::RottenFrames rotten = store::RottenFrames::kAbsent;
  int quality = store::RetimeOptions{}.quality, threads = 0;
  std::vector<double> flash_window;
  bool flash = false, keep_start_up = false, json = false, quiet = false;
};

Nanoseconds from_ms(double milliseconds) {
  return static_cast<Nanoseconds>(std::llround(milliseconds * kNsPerMs));
}

/// Returns the ticks per second that --fps states, Hz; 0: none. 23.976, 23.98 and 29.97 mean
/// n * 1000/1001, as in shots. Other numbers mean themselves, also measured ones close to these.
double rate_from(const std::string& text) {
  if (const auto ratio = frame_rate_from(text)) return ratio->fps();
  const double number = parse_number<double>(text).value_or(0);
  const auto rate = frame_rate_from(number);
  for (double scale = 100; rate && scale <= 1e6; scale *= 10) {
    if (number == std::round(rate->fps() * scale) / scale) return rate->fps();
  }
  return number;
}

std::string rate_error(const std::string& text) {
  const double rate = rate_from(text);
  if (rate >= 1e-3 && rate <= 1e6) return "";
  return fmt::format(
      "found \"{}\", allowed: a rate of 0.001 to 1000000 Hz, for example 24, or a ratio up to 1000 "
      "Hz, for example 24000/1001",
      text);
}

/// Returns " (24000/1001)" for such a rate.
std::string ratio_text(double fps) {
  const auto rate = frame_rate_from(fps);
  if (!rate || rate->denominator != 1001 || rate->fps() != fps) return "";
  return fmt::format(" ({}/{})", rate->numerator, rate->denominator);
}

void print_text(const store::ResyncResult& resync, const std::vector<std::string>& verdict) {
  const store::Timeline& timeline = resync.timeline;
  const store::TimelineStatistics statistics = store::timeline_statistics(timeline);
  const long absent = std::reduce(statistics.absent.begin(), statistics.absent.end(), 0L);
  const auto all = static_cast<double>(statistics.absent.size() * timeline.ticks.size());
  for (const std::string& sentence : verdict) print("{}\n", sentence);
  print("Rate       {:.6g} Hz{}\n", timeline.fps, ratio_text(timeline.fps));
  print("Ticks      {}, from {:.6f} s to {:.6f} s\n", timeline.ticks.size(),
        static_cast<double>(timeline.ticks.front().time_ns) / kNsPerS,
        static_cast<double>(timeline.ticks.back().time_ns) / kNsPerS);
  print("Tolerance  {:.3f} ms\n", static_cast<double>(timeline.tolerance) / kNsPerMs);
  print("Spread     mean {:.3f} ms, median {:.3f} ms, at most {:.3f} ms\n",
        statistics.mean_spread_ns / kNsPerMs,
        static_cast<double>(statistics.median_spread) / kNsPerMs,
        static_cast<double>(statistics.max_spread) / kNsPerMs);
  print("Absent     {} of {:.0f} frames ({:.2f} %)", absent, all,
        100 * static_cast<double>(absent) / all);
  const auto empty_ticks = std::ranges::count(timeline.ticks, 0, &store::FrameSelection::present);
  if (empty_ticks > 0) print("; at {} ticks from all cameras", empty_ticks);
  print("\n");
}

store::FlashOffsets find_flashes(const store::Take& take,
                                 const std::vector<store::CameraTimestamps>& cameras,
                                 const store::ResyncOptions& settings, const Options& options,
                                 std::stop_token stop) {
  const store::ResyncResult resync = store::resynchronise(cameras, settings, options.take);
  Nanoseconds begin = std::numeric_limits<Nanoseconds>::min() + 1;
  Nanoseconds end = std::numeric_limits<Nanoseconds>::max();
  if (!options.flash_window.empty()) {
    begin = from_ms(options.flash_window[0] * 1e3);
    end = from_ms(options.flash_window[1] * 1e3);
  }
  Progress progress(!options.quiet);
  const auto luminance = store::measure_luminance(
      take, resync.times, begin, end, [&](double done) { progress.report(done); }, stop);
  std::vector<std::vector<store::FlashOnset>> jumps;
  std::vector<std::string> group;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const rig::Rig::Camera& camera = take.rig().cameras[c];
    const double read_out_ms = rig::read_out_ms(camera.line_time_us, camera.model.height());
    jumps.push_back(store::find_flash_onsets(resync.times[c], luminance[c], from_ms(read_out_ms)));
    const bool by_node = options.flash_per == "node" && !cameras[c].node.empty();
    group.push_back(by_node ? cameras[c].node : cameras[c].id);
  }
  return store::offsets_from_flashes(jumps, group, options.take);
}

store::RetimeReport retime(const store::Take& take, const store::ResyncResult& resync,
                           const Options& options, const std::stop_token& stop) {
  store::RetimeOptions settings;
  settings.method = options.retime;
  settings.max_gap = from_ms(options.longest_gap_ms);
  settings.quality = options.quality;
  settings.rotten_frames = options.rotten;
  Progress progress(!options.quiet);
  return store::retime_take(
      take, resync.timeline, resync.times, settings, options.output, "raystage " RAYSTAGE_VERSION,
      [&](double done) { progress.report(done); }, stop);
}

void print_text(const store::RetimeReport& report, const std::string& output) {
  print("Retimed    {}: {} frames interpolated, {} unchanged, {} missing\n", output,
        report.interpolated, report.unchanged, report.missing);
  if (report.rotten > 0) {
    print(
        "Rotten     {} frames were left out, because they are not as recorded (XXH3), of cameras: "
        "{}. Run `raystage verify` on the take\n",
        report.rotten, fmt::format("{}", fmt::join(report.rotten_cameras, ", ")));
  }
  if (report.uncorrected > 0) {
    print("Shutter    {} frames keep their rolling shutter: no other frame of the camera is near\n",
          report.uncorrected);
  }
  const store::TimelineStatistics there =
      store::timeline_statistics(store::read_timeline(store::Take(output)));
  print("Spread     after retiming: mean {:.3f} ms, at most {:.3f} ms\n",
        there.mean_spread_ns / kNsPerMs, static_cast<double>(there.max_spread) / kNsPerMs);
  if (report.interpolated > 0)
    print("Cost       {:.1f} ms per interpolated frame\n", report.ms_per_interpolated);
}

void print_json(const store::ResyncResult& resync, const std::optional<store::FlashOffsets>& flash,
                const std::optional<store::RetimeReport>& retimed) {
  auto json = nlohmann::ordered_json::parse(store::resync_report_json(resync, flash));
  if (retimed) {
    json["retimed"] = {{"interpolated", retimed->interpolated},
                       {"unchanged", retimed->unchanged},
                       {"uncorrected_rolling_shutter", retimed->uncorrected},
                       {"missing", retimed->missing},
                       {"rotten", retimed->rotten},
                       {"rotten_cameras", retimed->rotten_cameras},
                       {"ms_per_interpolated", retimed->ms_per_interpolated}};
    constexpr schemas::FormerName kFormerNames[] = {{"interpolated", "moved"},
                                                    {"unchanged", "as_they_were"},
                                                    {"ms_per_interpolated", "ms_per_moved"}};
    schemas::add_former_names(json["retimed"], kFormerNames);
  }
  print(schemas::dump_json(json) + "\n");
}

/// Refuses line times that no frame can have where rows are moved by them; otherwise warns.
void check_line_times(const store::Take& take, const store::Timeline& timeline, bool moves_rows) {
  std::vector<double> periods_ns;
  for (const store::CameraClock& clock : timeline.clocks) periods_ns.push_back(clock.period_ns);
  const auto error = rig::line_time_error(take.rig(), periods_ns, take.document().nominal_fps,
                                          (take.folder() / "rig.json").string());
  if (!error) return;
  if (moves_rows) throw Error(*error);
  print_error("raystage sync: warning: {}\n", error->what());
}

void say_what_is_elsewhere(const store::Take& take) {
  int cameras = 0;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    cameras += take.archive(camera).is_remote() ? 1 : 0;
  }
  if (cameras == 0) return;
  print_error(
      "raystage sync: {} of {} archives are not here (on other hosts, or lost); their times are "
      "read from the journals\n",
      cameras, take.camera_count());
}

ExitCode sync(const Options& options, std::stop_token stop) {
  if (options.retime != store::RetimeMethod::kNearest && options.output.empty()) {
    throw Error::bad_input("blend and flow need a new take", "--retime", "Add -o NEWTAKE");
  }
  if (!options.flash_window.empty() && options.flash_window[0] >= options.flash_window[1]) {
    throw Error::bad_input("the end of the range is not after its beginning", "--flash-window",
                           "Use BEGIN < END, both in seconds");
  }
  if (options.output.empty()) store::require_no_bag_payload(options.take);
  if (!options.output.empty() && is_name_taken(options.output)) {
    throw Error::bad_input("the folder exists", options.output,
                           "Choose another name, or remove the folder");
  }
  const ThreadLimit limit(options.threads);
  const store::Take take(options.take, store::make_journal_archives(options.take));
  say_what_is_elsewhere(take);
  const std::vector<store::CameraTimestamps> cameras = store::camera_timestamps(take);
  store::ResyncOptions settings;
  settings.fps = rate_from(options.fps);
  settings.tolerance = from_ms(options.tolerance_ms);
  settings.trust_timestamps =
      options.stamps == "exact" ||
      (options.stamps == "auto" && !store::has_arrival_timestamps(take.document()));
  settings.keep_start_up = options.keep_start_up;
  if (options.tick_at) settings.tick_at = from_ms(*options.tick_at * 1e3);
  settings.nominal_fps = take.document().nominal_fps;
  if (!options.node_offsets.empty()) {
    settings.offsets = store::read_node_offsets(options.node_offsets, cameras);
  }
  std::optional<store::FlashOffsets> flash;
  if (options.flash) {
    flash = find_flashes(take, cameras, settings, options, stop);
    if (stop.stop_requested()) return ExitCode::kFailed;
    store::add_offsets(*flash, options.flash_per == "node", cameras, settings.offsets);
  }
  const store::ResyncResult resync = store::resynchronise(cameras, settings, options.take);
  check_line_times(take, resync.timeline, options.retime == store::RetimeMethod::kFlow);
  if (options.output.empty()) store::write_timeline(resync.timeline, take);
  if (!options.report.empty()) {
    write_file_atomically(options.report,
                          store::resync_report_html(resync, flash, take.document().name));
  }
  std::optional<store::RetimeReport> retimed;
  if (!options.output.empty()) retimed = retime(take, resync, options, stop);
  if (options.json) {
    print_json(resync, flash, retimed);
  } else {
    print_text(resync, store::resync_findings(resync, flash));
    const store::ShutterSummary shutters = store::summarise_shutters(take.rig());
    if (!shutters.is_global()) {
      print("Shutter    {}; the time of a frame is that of its middle row\n",
            shutter_text(shutters));
    }
    if (retimed) print_text(*retimed, options.output);
    print_depth_range_hint(options.output.empty() ? options.take : options.output);
  }
  const ExitCode code = retimed && retimed->rotten > 0 ? ExitCode::kFellShort : ExitCode::kSuccess;
  if (retimed) {
    record_event(options.output, "modification", "sync --retime: a new take",
                 fmt::format("{} frames interpolated, {} unchanged, {} missing",
                             retimed->interpolated, retimed->unchanged, retimed->missing),
                 outcome_of(code));
  } else {
    record_event(options.take, "metadata modification", "sync: timeline.zst");
  }
  return code;
}

void add_retime_options(CommandLine& command, Options& options) {
  command.choice(
      "--retime", options.retime,
      {{"nearest", store::RetimeMethod::kNearest},
       {"blend", store::RetimeMethod::kBlend},
       {"flow", store::RetimeMethod::kFlow}},
      "Interpolation to the ticks' times in the new take: nearest (default) copies each frame byte "
      "for byte with its corrected time; blend averages the frames before and after; flow "
      "interpolates by optical flow, with occlusions filled from the frame that shows them, and "
      "moves the rows of rolling shutters to one time");
  command.option("-o,--output NEWTAKE", options.output,
                 "New take with the retimed frames and the timeline; TAKE is not modified");
  command
      .option("--max-gap", options.longest_gap_ms,
              "Maximum time between two frames to interpolate between, ms (default: 2.5 ticks, "
              "which bridges one missing frame)")
      .limits(1e-6, 1e9)
      .needs("--output");
  command
      .choice(
          "--rotten", options.rotten,
          {{"error", store::RottenFrames::kError}, {"absent", store::RottenFrames::kAbsent}},
          "Stored frames that are not as recorded (XXH3): error = no new take is written; absent "
          "= the frame counts as missing, and the exit code is 4 (default: absent)")
      .needs("--output");
  command
      .option("--quality", options.quality,
              "JPEG quality of interpolated frames, 1-100; those of more than 8 bits have no loss")
      .show_default()
      .limits(1, 100)
      .needs("--output");
  add_threads_option(command, options.threads);
}

void add_options(CommandLine& command, Options& options) {
  command.option("TAKE", options.take, "Folder of the take").required();
  command
      .option("--fps RATE", options.fps,
              "Ticks per second, Hz: a number or a ratio such as 24000/1001; 23.976, 23.98, 29.97 "
              "and 59.94 mean n * 1000/1001 (default: the cameras' measured rate)")
      .check(rate_error);
  command
      .option("--tolerance", options.tolerance_ms,
              "Maximum difference of a frame's time from its tick, ms (default: half a tick); a "
              "camera without such a frame is absent at the tick")
      .limits(1e-6, 1e9);
  command
      .option("--tick-at", options.tick_at,
              "Time of one of the ticks, s since the take's epoch (default: the best fit to the "
              "frames)")
      .limits(-1e7, 1e7);
  command
      .option("--timestamps", options.stamps,
              "How frames were stamped: exact = at exposure; jittered = on arrival, so that "
              "exposure times are estimated from the camera's period; auto = as take.json's "
              "timestamp_event says (default: auto)")
      .one_of({"auto", "exact", "jittered"});
  command.flag("--keep-start-up", options.keep_start_up,
               "Include the start-up, during which cameras drop frames");
  command
      .option("--node-offsets", options.node_offsets,
              "JSON file {\"node\": ms}: clock offset of each node (or camera), ms; positive: the "
              "clock is ahead")
      .help_text("FILE");
  command
      .flag("--flash", options.flash,
            "Estimate clock offsets from flashes of light that all cameras see; decodes frames")
      .excludes("--node-offsets");
  command.option("--flash-clock", options.flash_per, "Offsets per node or camera (default: node)")
      .one_of({"node", "camera"})
      .needs("--flash");
  command
      .option(
          "--flash-window", options.flash_window,
          "Time range to search for flashes, s since the take's epoch (default: the whole take)")
      .expected(2, 2)
      .limits(-1e9, 1e9)
      .help_text("BEGIN END")
      .needs("--flash");
  command.option("--report", options.report, "Write an HTML page with charts and the verdict")
      .help_text("FILE.html");
  add_retime_options(command, options);
  command.flag("--json", options.json, "Print the results as JSON");
  add_follow_links_option(command);
  command.flag("-q,--quiet", options.quiet, "No progress on stderr");
}

}  // namespace
}  // namespace raystage::cli

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command(
      "Resynchronises free-running cameras: ticks at a constant rate with the nearest frame of\n"
      "each camera. Estimates the cameras' periods and phases, finds clock steps and dropped\n"
      "frames. Writes TAKE/timeline.zst, or with -o a new take; the archives are not modified.",
      "raystage sync");
  Options options;
  add_options(command, options);
  command.footer(
      "Exit codes: 0 done; 1 failed; 2 bad usage or input; 4 the new take is complete, but rotten "
      "frames were\nleft out (--rotten absent); 128+n stopped by signal n.");
  return parse_and_run(command, argc, argv, "sync",
                       [&](std::stop_token stop) { return sync(options, stop); }, OnSignal::kAbort,
                       {{"--flash-per", "--flash-clock"},
                        {"--longest-gap", "--max-gap"},
                        {"--stamps", "--timestamps"}});
}
