// SPDX-License-Identifier: Apache-2.0
// raystage plan epi: measures the depth range of a take by epipolar-plane images.
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>

#include "base/atomic_file.h"
#include "base/error.h"
#include "cli/follow_links_option.h"
#include "cli/plan.h"
#include "cli/printing.h"
#include "cli/shot_options.h"
#include "cli/take_event.h"
#include "cli/threads.h"
#include "planning/epipolar/measured_depths.h"
#include "planning/epipolar/measured_depths_report.h"
#include "schemas/take_document.h"
#include "store/take.h"

namespace raystage::cli {
namespace {

struct EpiCommand {
  std::filesystem::path take, report;
  planning::DepthMeasurementOptions options;
  int threads = 0;
  bool write = false, json = false;
  ProgressStyle progress = ProgressStyle::kAuto;
};

ExitCode run_epi(const EpiCommand& command, const std::stop_token& stop) {
  const store::Take take(command.take);
  std::error_code unknown;  // writing reports it then
  if (command.write && std::filesystem::is_symlink(take.folder() / "take.json", unknown)) {
    throw Error::bad_input("take.json is a link, and nothing is written through links",
                           command.take.string(), "Measure the take that it refers to");
  }
  Progress progress(command.progress);
  const auto report_progress = [&](double done) { progress.report(done); };
  const planning::MeasuredDepths depths =
      planning::measure_depths(take, command.options, report_progress, stop);
  if (!command.report.empty()) {
    write_file_atomically(command.report, planning::measured_depths_as_page(depths));
  }
  if (command.write && depths.range) {
    // Read again: the measurement takes long enough for somebody else to change the document.
    schemas::TakeDocument document = schemas::read_take(take.file("take.json"));
    document.depth_range = depths.range;
    schemas::write_take(document, take.folder() / "take.json");
    record_event(
        command.take, "metadata modification", "plan epi --write: take.json",
        fmt::format("depth range {:.6g} to {:.6g} m", depths.range->near, depths.range->far));
  }
  print(command.json ? planning::measured_depths_as_json(depths)
                     : planning::format_measured_depths(depths));
  if (command.write && depths.range && !command.json) print("Written to take.json.\n");
  return depths.range ? ExitCode::kSuccess : ExitCode::kFellShort;
}

}  // namespace

Subcommand declare_plan_epi(CommandLine& plan) {
  auto options = std::make_shared<EpiCommand>();
  CommandLine command =
      plan.subcommand("epi", "Measure the depth range of a take by epipolar-plane images");
  command.option("TAKE", options->take, "the take").required();
  command
      .option("--instants N", options->options.instants,
              "instants that are measured, evenly spaced over the take (default: 3)")
      .limits(1.0, 1000.0);
  command
      .option("--cameras N", options->options.cameras,
              "cameras whose pixels are measured at each instant: more find smaller things "
              "(default: 16)")
      .limits(2.0, 100000.0);
  command.flag(
      "--write", options->write,
      "write the range to depth_range_m in the take's take.json, in place of the one there");
  command.option("--report FILE.html", options->report,
                 "write the result as a page with the epipolar-plane images");
  command.flag("--json", options->json, "print the result as JSON");
  add_threads_option(command, options->threads);
  add_progress_option(command, options->progress);
  add_follow_links_option(command);
  return {command, [options](const std::stop_token& stop) {
            return run_with_threads(options->threads, [&] { return run_epi(*options, stop); });
          }};
}

}  // namespace raystage::cli
