// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "calibrate/flat_target.h"
#include "cli/calibrate.h"
#include "cli/threads.h"
#include "schemas/rig_document.h"

namespace raystage {
namespace {

struct ColorOptions {
  std::vector<std::filesystem::path> takes;
  std::filesystem::path output, start, dark;
  std::string reference;
  bool neutral = false, vignetting = false, force = false;
  int threads = 0;
};

ExitCode calibrate_color(const ColorOptions& options, const std::stop_token& stop) {
  const ThreadLimit limit(options.threads);
  RigDocument rig =
      read_rig(options.start.empty() ? options.takes.front() / "rig.json" : options.start);
  std::vector<FlatSights> targets;
  std::vector<std::string> cameras;
  std::vector<std::filesystem::path> takes = options.takes;
  if (!options.dark.empty()) takes.push_back(options.dark);
  for (const std::filesystem::path& folder : takes) {
    const Take take(folder);
    std::vector<std::string> ids;
    for (const auto& camera : take.document().cameras) ids.push_back(camera.id);
    if (cameras.empty()) cameras = ids;
    if (ids != cameras) {
      throw Error::bad_input("the take has other cameras than the first", folder.string(),
                             "Record all targets with the same cameras");
    }
    targets.push_back(flat_sights(take, stop));
  }
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
  const FlatColors colors = match_flat_targets(targets, cameras, settings);
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
  write_rig(rig, options.output);
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
  app->add_option("-o,--output", o->output, "The rig that is written: --start, with colours")
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
  app->add_flag("--vignetting", o->vignetting,
                "Also the fall of light towards the corners: the brightest target fills every "
                "picture, and is as bright everywhere");
  app->add_flag("--neutral", o->neutral, "White balance: the brightest target becomes grey");
  app->add_flag("--force", o->force, "Write the rig even if it cannot be vouched for");
  add_threads_option(*app, o->threads);
  return {app, [o](const std::stop_token& stop) { return calibrate_color(*o, stop); }};
}

}  // namespace raystage
