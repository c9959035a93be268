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
#include "calibrate/scene_color.h"
#include "cli/calibrate.h"
#include "cli/threads.h"
#include "rig/rig.h"
#include "schemas/atomic_file.h"
#include "schemas/rig_document.h"
#include "store/jpeg/encode.h"
#include "store/scene_depths.h"

namespace raystage {
namespace {

struct ColorOptions {
  std::vector<std::filesystem::path> takes;
  std::filesystem::path scene, output, start, dark, sheet, sheet_of;
  std::string reference;
  std::vector<double> exposures;
  double focal_depth = 0, near = 0, far = 0;  // metres; 0: not given
  bool neutral = false, vignetting = false, force = false, json = false, quiet = false;
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

/// What was found about which cameras.
struct FoundColors {
  std::vector<std::string> cameras;  ///< their ids
  int reference = 0;                 ///< one of them
  ColorMatch match;
};

int reference_of(const ColorOptions& options, const std::vector<std::string>& cameras) {
  if (options.reference.empty()) return 0;
  const auto found = std::ranges::find(cameras, options.reference);
  if (found == cameras.end()) {
    throw Error::bad_input("there is no camera \"" + options.reference + "\"", "--reference",
                           "Name a camera of the takes");
  }
  return static_cast<int>(found - cameras.begin());
}

FoundColors found_on_targets(const ColorOptions& options, const std::stop_token& stop) {
  const Targets targets = open_targets(options);
  FlatColorSettings settings;
  settings.reference = reference_of(options, targets.cameras);
  settings.neutral = options.neutral;
  settings.vignetting = options.vignetting;
  settings.dark = !options.dark.empty();
  std::vector<FlatSights> sights = sights_of(targets, {}, stop);
  if (!options.exposures.empty()) {
    settings.curves = curves_of(options, targets, sights);
    sights = sights_of(targets, settings.curves, stop);
    leave_out_overexposed(sights);
  }
  return {targets.cameras, settings.reference,
          match_flat_targets(sights, targets.cameras, settings)};
}

/// The depths of --focal-depth, to a tenth of it, or of --near and --far, or as the take says.
DepthRange depths_of(const ColorOptions& options, const Take& take) {
  constexpr double kAround = 1.1;
  if (options.focal_depth > 0) {
    return {options.focal_depth / kAround, options.focal_depth * kAround};
  }
  return scene_depths(take, {options.near, options.far}, "matching colours",
                      "Give --near and --far, or --focal-depth, in metres in front of the array");
}

FoundColors found_in_scene(const ColorOptions& options, const RigDocument& document,
                           const std::stop_token& stop) {
  const Take take(options.scene);
  RigDocument in_order = document;  // as the take's cameras
  in_order.cameras.clear();
  FoundColors found;
  for (const auto& camera : take.document().cameras) {
    const auto same = std::ranges::find(
        document.cameras, camera.id,
        [](const RigDocument::Camera& of) -> const std::string& { return of.geometry.id; });
    if (same == document.cameras.end()) {
      throw Error::bad_input("the rig has no camera \"" + camera.id + "\"",
                             options.start.empty() ? "rig.json" : options.start.string(),
                             "Give the rig of the take's cameras with --start");
    }
    in_order.cameras.push_back(*same);
    found.cameras.push_back(camera.id);
  }
  found.reference = reference_of(options, found.cameras);
  const Rig rig = rig_from_document(in_order);
  SurfaceSettings settings;
  settings.depths = depths_of(options, take);
  Progress progress(!options.quiet);
  const std::vector<SurfacePoint> points = surface_points(
      take, rig, settings, [&](double done) { progress.report(done); }, stop);
  found.match = match_scene_colors(points, rig, found.reference, stop);
  return found;
}

void check_inputs(const ColorOptions& options) {
  if (options.takes.empty() == options.scene.empty()) {
    throw Error::bad_input("there has to be either a target or a scene", "calibrate color",
                           "Give takes of targets, or --scene TAKE");
  }
}

/// The rig that gets colours: --start, or that of the take.
RigDocument rig_to_start_from(const ColorOptions& options) {
  const auto& take = options.scene.empty() ? options.takes.front() : options.scene;
  return read_rig(options.start.empty() ? take / "rig.json" : options.start);
}

ExitCode calibrate_color(const ColorOptions& options, const std::stop_token& stop) {
  const ThreadLimit limit(options.threads);
  check_inputs(options);
  RigDocument rig = rig_to_start_from(options);
  const FoundColors found =
      options.scene.empty() ? found_on_targets(options, stop) : found_in_scene(options, rig, stop);
  const std::vector<std::string>& cameras = found.cameras;
  const std::string& reference = cameras[static_cast<std::size_t>(found.reference)];
  fmt::print("{}", options.json ? color_json(found.match, reference, cameras)
                                : color_text(found.match, reference));
  if (!found.match.reasons.empty() && !options.force) {
    throw Error::failed("the rig was not written, as nobody could rely on its colours",
                        options.output.string(),
                        "Do what stands under \"Not sure\"; --force writes it all the same");
  }
  for (RigDocument::Camera& camera : rig.cameras) {
    const auto same = std::ranges::find(cameras, camera.geometry.id);
    if (same == cameras.end()) {
      throw Error::bad_input("the takes have no camera \"" + camera.geometry.id + "\"",
                             options.start.string(), "Give the rig of the same cameras");
    }
    camera.photometric = found.match.responses[static_cast<std::size_t>(same - cameras.begin())];
  }
  std::vector<std::byte> sheet;  // before anything is written, as it may fail
  if (!options.sheet.empty()) {
    const Take shown(!options.sheet_of.empty() ? options.sheet_of
                     : options.scene.empty()   ? options.takes.front()
                                               : options.scene);
    sheet = encode_jpeg(color_sheet(shown, rig), {});
  }
  write_rig(rig, options.output);
  if (!sheet.empty()) write_file_atomically(options.sheet, sheet);
  return ExitCode::kSuccess;
}

void add_scene(CLI::App& app, ColorOptions& o, CLI::Option* takes) {
  const char* group = "Without a target";
  CLI::Option* const scene =
      app.add_option(
             "--scene", o.scene,
             "A take of any scene with patterned surfaces: contrast and brightness by which "
             "the cameras agree about the same places of it. Needs a rig that is "
             "calibrated; all else that it knows of colours stays")
          ->type_name("TAKE")
          ->excludes(takes)
          ->group(group);
  const auto depth = [&](const char* name, double& value, const char* what) {
    return app.add_option(name, value, what)
        ->needs(scene)
        ->check(CLI::Range(1e-3, 1e7).description(""))
        ->type_name("METRES")
        ->group(group);
  };
  depth("--near", o.near, "Nothing is nearer, metres in front of the array (default: the take's)");
  depth("--far", o.far, "Nothing is farther (default: the take's)");
  depth("--focal-depth", o.focal_depth,
        "Only surfaces at this depth count, metres in front of the array, to a tenth of it")
      ->excludes("--near")
      ->excludes("--far");
}

void add_target_options(CLI::App& app, ColorOptions& o, CLI::Option* takes) {
  const char* group = "With targets";
  app.add_option("--dark", o.dark,
                 "Take with capped lenses: light counts from there, and pixels that stand out of "
                 "it are corrected")
      ->type_name("TAKE")
      ->needs(takes)
      ->group(group);
  app.add_option("--exposures", o.exposures,
                 "The takes show one target that does not move, exposed for as long (any unit, one "
                 "number a take): also how each camera's codes follow light, whatever curve it has")
      ->delimiter(',')
      ->check(CLI::Range(1e-9, 1e9))
      ->type_name("T1,T2,...")
      ->needs(takes)
      ->group(group);
  app.add_flag("--vignetting", o.vignetting,
               "Also the fall of light towards the corners: the brightest target fills every "
               "picture, and is as bright everywhere")
      ->needs(takes)
      ->group(group);
  app.add_flag("--neutral", o.neutral, "White balance: the brightest target becomes grey")
      ->needs(takes)
      ->group(group);
}

}  // namespace

CalibrateCommand declare_calibrate_color(CLI::App& calibrate) {
  auto o = std::make_shared<ColorOptions>();
  CLI::App* app = calibrate.add_subcommand(
      "color",
      "Contrast and brightness of every camera and channel, from targets without features or "
      "from a scene");
  CLI::Option* const takes = app->add_option(
      "TAKE", o->takes,
      "Takes of a target that fills the middle of every picture and is everywhere as "
      "bright, each of another brightness: lens caps, grey, white (one alone tells the "
      "contrast only)");
  app->add_option("-o,--output", o->output,
                  "The rig that is written: --start, with colours found here in place of its own")
      ->required()
      ->type_name("RIG.json");
  app->add_option("--start", o->start, "The rig that gets colours (default: the first take's)")
      ->type_name("RIG.json");
  app->add_option("--reference", o->reference,
                  "Camera that the others are made alike to (default: the first)")
      ->type_name("ID");
  add_scene(*app, *o, takes);
  add_target_options(*app, *o, takes);
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
  app->add_flag("--json", o->json, "Print everything found as JSON");
  app->add_flag("-q,--quiet", o->quiet, "No progress on stderr");
  return {app, [o](const std::stop_token& stop) { return calibrate_color(*o, stop); }};
}

}  // namespace raystage
