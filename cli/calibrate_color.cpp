// SPDX-License-Identifier: Apache-2.0
// raystage calibrate color: estimates the colour response of every camera.
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <vector>

#include "base/atomic_file.h"
#include "calibrate/color/color_contact_sheet.h"
#include "calibrate/color_from_takes.h"
#include "cli/calibrate.h"
#include "cli/calibrate_color_options.h"
#include "cli/printing.h"
#include "cli/take_event.h"
#include "cli/threads.h"
#include "schemas/rig_document.h"
#include "store/jpeg/encode.h"

namespace raystage::cli {
namespace {

/// Returns the take that the rig and the contact sheet come from by default.
const std::filesystem::path& first_take(const calibrate::ColorFromTakesOptions& settings) {
  if (!settings.targets.empty()) return settings.targets.front();
  const auto& take = settings.chart.empty() ? settings.scene : settings.chart;
  if (take.empty()) {
    throw Error::bad_input("no target, colour chart or scene", "calibrate color",
                           "Add takes of targets, --chart TAKE or --scene TAKE");
  }
  return take;
}

ExitCode run_calibrate_color(const CalibrateColorOptions& options, const std::stop_token& stop) {
  const ThreadLimit limit(options.threads);
  const std::filesystem::path& take = first_take(options.settings);
  check_writable(options.output);
  if (!options.sheet.empty()) check_writable(options.sheet);
  const std::filesystem::path rig_file = options.start.empty() ? take / "rig.json" : options.start;
  const schemas::RigDocument start = schemas::read_rig(rig_file);
  Progress progress(!options.quiet);
  const calibrate::ColorFromTakes found = calibrate::calibrate_color(
      options.settings, start, rig_file, [&](double done) { progress.report(done); }, stop);
  print(options.json ? calibrate::color_match_json(found.steps, found.reference_id(), found.cameras)
                     : calibrate::format_color_match(found.steps, found.reference_id()));
  if (!found.is_accepted() && !options.force) {
    throw Error::failed(
        "the rig was not written: the colour calibration was rejected (see \"Rejected\")",
        options.output.string(), "Use --force to write it anyway");
  }
  const schemas::RigDocument rig = calibrate::with_color_responses(start, rig_file, found);
  std::vector<std::byte> sheet;  // before anything is written, as it may fail
  if (!options.sheet.empty()) {
    const store::Take shown(options.sheet_of.empty() ? take : options.sheet_of);
    sheet = store::encode_jpeg(calibrate::make_color_contact_sheet(shown, rig), {});
  }
  if (!sheet.empty()) write_file_atomically(options.sheet, sheet);
  schemas::write_rig(rig, options.output);
  record_rig_event(options.output, "calibrate color");
  return ExitCode::kSuccess;
}

}  // namespace

Subcommand declare_calibrate_color(CommandLine& calibrate) {
  auto o = std::make_shared<CalibrateColorOptions>();
  CommandLine command = calibrate.subcommand(
      "color",
      "Estimate the colour response of every camera from flat targets, a colour chart or a scene");
  add_calibrate_color_options(command, *o);
  return {command, [o](const std::stop_token& stop) { return run_calibrate_color(*o, stop); }};
}

}  // namespace raystage::cli
