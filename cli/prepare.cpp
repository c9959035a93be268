// SPDX-License-Identifier: Apache-2.0
// raystage prepare: derives and stores the data that the frames of a shot need.
#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <charconv>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/follow_links_option.h"
#include "cli/printing.h"
#include "cli/sandbox_option.h"
#include "cli/shot_options.h"
#include "cli/simd_option.h"
#include "cli/threads.h"
#include "compose/derived_data.h"
#include "compose/frame_range.h"
#include "compose/sequence.h"

namespace raystage::cli {
namespace {

constexpr double kBytesPerGb = 1e9, kMinMemoryGb = 1e-3, kMaxMemoryGb = 1e5;

struct Options {
  std::filesystem::path shot, cache_folder, color_config, relative_to;
  std::string frames, instants, pin, simd;
  compose::MissingFrames missing = compose::MissingFrames::kError;
  int threads = 0;
  double memory_gb = 0;
  bool list = false;
  ProgressStyle progress = ProgressStyle::kAuto;
};

void declare(CommandLine& command, Options& options, char** argv) {
  command.option("SHOT", options.shot, "the shot (shot.json)").required();
  command.option("--frames RANGE", options.frames,
                 "frames to derive data for, e.g. 1-48, 1-48x2 (every second), 1,5,10-20; frames "
                 "outside\nthe shot are ignored (default: all of the shot)");
  command.option("--instants LAYER:TICK,...", options.instants,
                 "restrict to these instants of layers, both counted from 0, as --list prints "
                 "them, e.g.\n0:12,0:13,2:5: ticks, and beyond these exact times (default: all of "
                 "the frames)");
  add_missing_option(command, options.missing);
  add_relative_to_option(command, options.relative_to);
  add_cache_option(command, options.cache_folder);
  command.option("--pin NAME", options.pin,
                 "keep the data from eviction for 30 days: writes a file pin.NAME to each folder "
                 "with\ndata; delete that file to unpin it");
  command
      .option("--memory GB", options.memory_gb,
              "memory for decoded source frames and the method's buffers, GB = 10^9 bytes "
              "(default:\nhalf of the machine's or control group's, at most 4 GiB for each)")
      .range(kMinMemoryGb, kMaxMemoryGb);
  add_threads_option(command, options.threads);
  add_simd_option(command, options.simd, argv);
  command.option(
      "--ocio CONFIG", options.color_config,
      "OpenColorIO config of the shot, as raystage render (stored data does not depend on it)");
  add_follow_links_option(command);
  add_sandbox_option(command);
  add_progress_option(command, options.progress);
  command
      .flag("--list", options.list,
            "derive nothing; print for each light field frame, separated by tabs: LAYER:TICK, "
            "stored or\nmissing, the frames that need it, the file")
      .excludes("--pin");
  command.footer(
      "Exit codes: 0 all data is stored; 1 failed; 2 bad usage or input; 3 some failed, the rest\n"
      "is stored; 33 out of memory; 128+n stopped by signal n.");
}

/// Throws Error (bad input), which quotes the text that is not LAYER:TICK.
std::vector<compose::LayerTick> parse_instants(const std::string& text) {
  std::vector<compose::LayerTick> instants;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const char *at = text.data() + begin, *last = text.data() + end;
    compose::LayerTick instant;
    const auto layer = std::from_chars(at, last, instant.layer);
    const bool has_colon = layer.ec == std::errc() && layer.ptr != last && *layer.ptr == ':';
    const auto tick = std::from_chars(has_colon ? layer.ptr + 1 : last, last, instant.tick);
    if (!has_colon || tick.ec != std::errc() || tick.ptr != last || instant.tick < 0) {
      throw Error::bad_input(
          fmt::format("\"{}\" is not LAYER:TICK", text.substr(begin, end - begin)), "--instants",
          "Use two numbers from 0, e.g. 0:12");
    }
    instants.push_back(instant);
    begin = end + 1;
  }
  return instants;
}

void print_list(std::span<const compose::DerivedFrameData> instants) {
  for (const compose::DerivedFrameData& instant : instants) {
    const std::string line =
        fmt::format("{}:{}\t{}\t{}\t{}\n", instant.layer, instant.tick,
                    instant.is_stored ? "stored" : "missing",
                    compose::format_frame_range(instant.frames), instant.file.string());
    print(line);
  }
}

std::string summary_of(const compose::PrepareReport& report) {
  std::string text = compose::format_stored_data_counts(report.derived, report.stored_before);
  if (!report.failures.empty()) text += fmt::format("; {} failed", report.failures.size());
  return text;
}

ExitCode prepare(const Options& options, std::stop_token stop) {
  Progress progress(options.progress);
  const auto say = [&](std::string_view line) { progress.say(line); };
  std::optional<std::vector<int>> requested;
  if (!options.frames.empty()) requested = compose::parse_frame_range(options.frames);
  std::optional<std::vector<compose::LayerTick>> wanted;
  if (!options.instants.empty()) wanted = parse_instants(options.instants);

  compose::ShotPlanOptions plan_options;
  plan_options.color_config = options.color_config;
  plan_options.frames = requested;
  plan_options.cache_folder = options.cache_folder;
  plan_options.folder = options.relative_to;
  const compose::ShotPlan plan(options.shot, plan_options);
  const std::vector<int> numbers = compose::frames_to_render(plan.shot(), requested, say);
  const std::vector<compose::PlannedFrame> frames = plan.plan(numbers, options.missing);
  const std::vector<compose::DerivedFrameData> instants =
      wanted ? compose::list_derived_data(plan, frames, *wanted)
             : compose::list_derived_data(plan, frames);
  if (options.list) {
    print_list(instants);
    return ExitCode::kSuccess;
  }
  if (!options.pin.empty()) {
    std::vector<std::filesystem::path> files;
    for (const compose::DerivedFrameData& instant : instants) files.push_back(instant.file);
    compose::pin_derived_data(files, options.pin);
  }
  compose::PrepareOptions how;
  how.memory_bytes = static_cast<std::size_t>(options.memory_gb * kBytesPerGb);
  how.progress = [&](double done) { progress.report(done); };
  how.on_message = say;
  const compose::PrepareReport report =
      compose::prepare_derived_data(plan, instants, how, std::move(stop));
  progress.say(summary_of(report));
  return report.exit_code();
}

}  // namespace
}  // namespace raystage::cli

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command{"Derives and stores the camera depths that the frames of a shot need.",
                      "raystage prepare"};
  Options options;
  declare(command, options, argv);
  return parse_and_run(command, argc, argv, "prepare", [&](std::stop_token stop) {
    const int threads = thread_count(options.threads);
    const ThreadLimit limit(threads);
    tbb::task_arena arena(threads);
    return arena.execute([&] { return prepare(options, stop); });
  });
}
