// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "calibrate/color_sheet.h"
#include "calibrate/flat_target.h"
#include "calibrate/response_curve.h"
#include "cli/calibrate.h"
#include "cli/threads.h"
#include "schemas/atomic_file.h"
#include "schemas/rig_document.h"
#include "store/jpeg/encode.h"

namespace raystage {
namespace {

struct ColorOptions {
  std::vector<std::filesystem::path> takes;
  std::filesystem::path output, start, dark, sheet, sheet_of;
  std::string reference;
  std::vector<double> exposures;
  bool neutral = false, vignetting = false, force = false;
  int threads = 0;
};

/// Targets, each a take of the same cameras.
struct Targets {
  std::vector<std::unique_ptr<Take>> takes;
  std::vector<std::string> cameras;
};

Targets open_targets(const ColorOptions& options) {
  std::vector<std::filesystem::path> folders = options.takes;
  if (!options.dark.empty()) folders.push_back(options.dark);
  Targets targets;
  for (const std::filesystem::path& folder : folders) {
    targets.takes.push_back(std::make_unique<Take>(folder));
    std::vector<std::string> ids;
    for (const auto& camera : targets.takes.back()->document().cameras) ids.push_back(camera.id);
    if (targets.cameras.empty()) targets.cameras = ids;
    if (ids != targets.cameras) {
      throw Error::bad_input("the take has other cameras than the first", folder.string(),
                             "Record all targets with the same cameras");
    }
  }
  return targets;
}

/// How cameras show the targets; the last is the dark one, where there is such.
std::vector<FlatSights> sights_of(const Targets& targets,
                                  const std::vector<PhotometricResponse>& responses,
                                  const std::stop_token& stop) {
  std::vector<FlatSights> sights;
  for (const auto& take : targets.takes) sights.push_back(flat_sights(*take, responses, stop));
  return sights;
}

std::vector<PhotometricResponse> curves_of(const ColorOptions& options, const Targets& targets,
                                           const std::vector<FlatSights>& sights) {
  if (options.exposures.size() != options.takes.size()) {
    throw Error::bad_input(fmt::format("there are {} exposures for {} takes",
                                       options.exposures.size(), options.takes.size()),
                           "--exposures", "Give each take's, in their order");
  }
  return find_response_curves(sights, options.exposures,
                              options.dark.empty() ? nullptr : &sights.back(),
                              targets.takes.front()->document().color_space);
}

/// Leaves exposures out that are too long for some camera: what they are for is the curve.
void leave_out_overexposed(std::vector<FlatSights>& sights) {
  constexpr double kClipped = 0.01;
  const auto is_overexposed = [](const FlatSights& target) {
    return std::ranges::any_of(target,
                               [](const FlatSight& sight) { return sight.clipped > kClipped; });
  };
  if (std::ranges::all_of(sights, is_overexposed)) return;  // said where colours are matched
  std::erase_if(sights, is_overexposed);
}

ExitCode calibrate_color(const ColorOptions& options, const std::stop_token& stop) {
  const ThreadLimit limit(options.threads);
  RigDocument rig =
      read_rig(options.start.empty() ? options.takes.front() / "rig.json" : options.start);
  const Targets targets = open_targets(options);
  const std::vector<std::string>& cameras = targets.cameras;
  FlatColorSettings settings;
  settings.neutral = options.neutral;
  settings.vignetting = options.vignetting;
  settings.dark = !options.dark.empty();
  if (!options.reference.empty()) {
    const auto found = std::ranges::find(cameras, options.reference);
    if (found == cameras.end()) {
      throw Error::bad_input("there is no camera \"" + options.reference + "\"", "--reference",
                             "Name a camera of the takes");
    }
    settings.reference = static_cast<int>(found - cameras.begin());
  }
  std::vector<FlatSights> sights = sights_of(targets, {}, stop);
  if (!options.exposures.empty()) {
    settings.curves = curves_of(options, targets, sights);
    sights = sights_of(targets, settings.curves, stop);
    leave_out_overexposed(sights);
  }
  const FlatColors colors = match_flat_targets(sights, cameras, settings);
  fmt::print("{}", color_text(colors, cameras[static_cast<std::size_t>(settings.reference)]));
  if (!colors.reasons.empty() && !options.force) {
    throw Error::failed("the rig was not written, as nobody could rely on its colours",
                        options.output.string(),
                        "Do what stands under \"Not sure\"; --force writes it all the same");
  }
  for (RigDocument::Camera& camera : rig.cameras) {
    const auto found = std::ranges::find(cameras, camera.geometry.id);
    if (found == cameras.end()) {
      throw Error::bad_input("the takes have no camera \"" + camera.geometry.id + "\"",
                             options.start.string(), "Give the rig of the same cameras");
    }
    camera.photometric = colors.responses[static_cast<std::size_t>(found - cameras.begin())];
  }
  std::vector<std::byte> sheet;  // before anything is written, as it may fail
  if (!options.sheet.empty()) {
    const Take shown(options.sheet_of.empty() ? options.takes.front() : options.sheet_of);
    sheet = encode_jpeg(color_sheet(shown, rig), {});
  }
  write_rig(rig, options.output);
  if (!sheet.empty()) write_file_atomically(options.sheet, sheet);
  return ExitCode::kSuccess;
}

}  // namespace

CalibrateCommand declare_calibrate_color(CLI::App& calibrate) {
  auto o = std::make_shared<ColorOptions>();
  CLI::App* app = calibrate.add_subcommand(
      "color",
      "Contrast and brightness of every camera and channel, from targets without features");
  app->add_option("TAKE", o->takes,
                  "Takes of a target that fills the middle of every picture and is everywhere as "
                  "bright, each of another brightness: lens caps, grey, white (one alone tells the "
                  "contrast only)")
      ->required();
  app->add_option("-o,--output", o->output,
                  "The rig that is written: --start, with colours found here in place of its own")
      ->required()
      ->type_name("RIG.json");
  app->add_option("--start", o->start, "The rig that gets colours (default: the first take's)")
      ->type_name("RIG.json");
  app->add_option("--reference", o->reference,
                  "Camera that the others are made alike to (default: the first)")
      ->type_name("ID");
  app->add_option("--dark", o->dark,
                  "Take with capped lenses: light counts from there, and pixels that stand out of "
                  "it are corrected")
      ->type_name("TAKE");
  app->add_option(
         "--exposures", o->exposures,
         "The takes show one target that does not move, exposed for as long (any unit, one "
         "number a take): also how each camera's codes follow light, whatever curve it has")
      ->delimiter(',')
      ->check(CLI::Range(1e-9, 1e9))
      ->type_name("T1,T2,...");
  app->add_flag("--vignetting", o->vignetting,
                "Also the fall of light towards the corners: the brightest target fills every "
                "picture, and is as bright everywhere");
  app->add_flag("--neutral", o->neutral, "White balance: the brightest target becomes grey");
  CLI::Option* const sheet =
      app->add_option(
             "--sheet", o->sheet,
             "Contact sheet: what cameras show, as recorded on the left, corrected on the right")
          ->type_name("FILE.jpg");
  app->add_option("--sheet-of", o->sheet_of,
                  "The take that the sheet shows (default: the first target)")
      ->type_name("TAKE")
      ->needs(sheet);
  app->add_flag("--force", o->force, "Write the rig even if it cannot be vouched for");
  add_threads_option(*app, o->threads);
  return {app, [o](const std::stop_token& stop) { return calibrate_color(*o, stop); }};
}

}  // namespace raystage
