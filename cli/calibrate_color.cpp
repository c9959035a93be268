// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "calibrate/color_chart.h"
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
  std::filesystem::path chart, scene, output, start, dark, sheet, sheet_of;
  std::string reference;
  std::vector<double> exposures;
  double focal_depth = 0, near = 0, far = 0;  // metres; 0: not given
  bool neutral = false, vignetting = false, flat_field = false, force = false, json = false,
       quiet = false, published = false;
  int threads = 0;
};

std::vector<std::string> ids_of(const Take& take) {
  std::vector<std::string> ids;
  for (const auto& camera : take.document().cameras) ids.push_back(camera.id);
  return ids;
}

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
    const std::vector<std::string> ids = ids_of(*targets.takes.back());
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
  std::vector<ColorMatch> steps;     ///< each on top of the one before
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

void match_targets(const ColorOptions& options, FoundColors& found, const std::stop_token& stop) {
  const Targets targets = open_targets(options);
  found.cameras = targets.cameras;
  found.reference = reference_of(options, targets.cameras);
  FlatColorSettings settings;
  settings.reference = found.reference;
  settings.neutral = options.neutral;
  settings.vignetting = options.vignetting;
  settings.flat_field = options.flat_field;
  settings.dark = !options.dark.empty();
  std::vector<FlatSights> sights = sights_of(targets, {}, stop);
  if (!options.exposures.empty()) {
    settings.curves = curves_of(options, targets, sights);
    sights = sights_of(targets, settings.curves, stop);
    leave_out_overexposed(sights);
  }
  found.steps.push_back(match_flat_targets(sights, targets.cameras, settings));
}

/// The rig with its cameras as the take has them.
RigDocument in_order_of(const std::vector<std::string>& cameras, const RigDocument& document,
                        const ColorOptions& options) {
  RigDocument ordered = document;
  ordered.cameras.clear();
  for (const std::string& id : cameras) {
    const auto same = std::ranges::find(
        document.cameras, id,
        [](const RigDocument::Camera& camera) -> const std::string& { return camera.geometry.id; });
    if (same == document.cameras.end()) {
      throw Error::bad_input("the rig has no camera \"" + id + "\"",
                             options.start.empty() ? "rig.json" : options.start.string(),
                             "Give the rig of the take's cameras with --start");
    }
    ordered.cameras.push_back(*same);
  }
  return ordered;
}

/// On top of what targets told, or else of what the rig knows.
void match_chart(const ColorOptions& options, const RigDocument& document, FoundColors& found,
                 const std::stop_token& stop) {
  const Take take(options.chart);
  std::vector<PhotometricResponse> responses;
  if (found.steps.empty()) {
    found.cameras = ids_of(take);
    found.reference = reference_of(options, found.cameras);
    for (const auto& camera : in_order_of(found.cameras, document, options).cameras) {
      responses.push_back(camera.photometric);
    }
  } else {
    responses = found.steps.back().responses;
    if (ids_of(take) != found.cameras) {
      throw Error::bad_input("the take has other cameras than the targets", options.chart.string(),
                             "Record the chart with the same cameras");
    }
  }
  found.steps.push_back(match_charts(chart_sights(take, responses, stop), responses, found.cameras,
                                     {found.reference, options.published}));
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

void match_scene(const ColorOptions& options, const RigDocument& document, FoundColors& found,
                 const std::stop_token& stop) {
  const Take take(options.scene);
  found.cameras = ids_of(take);
  found.reference = reference_of(options, found.cameras);
  const Rig rig = rig_from_document(in_order_of(found.cameras, document, options));
  SurfaceSettings settings;
  settings.depths = depths_of(options, take);
  Progress progress(!options.quiet);
  const std::vector<SurfacePoint> points = surface_points(
      take, rig, settings, [&](double done) { progress.report(done); }, stop);
  found.steps.push_back(match_scene_colors(points, rig, found.reference, stop));
}

/// The take that shows what is looked at first.
const std::filesystem::path& first_take(const ColorOptions& options) {
  if (!options.takes.empty()) return options.takes.front();
  const auto& take = options.chart.empty() ? options.scene : options.chart;
  if (take.empty()) {
    throw Error::bad_input("there is neither a target nor a scene", "calibrate color",
                           "Give takes of targets, --chart TAKE or --scene TAKE");
  }
  return take;
}

ExitCode calibrate_color(const ColorOptions& options, const std::stop_token& stop) {
  const ThreadLimit limit(options.threads);
  const std::filesystem::path& take = first_take(options);
  RigDocument rig = read_rig(options.start.empty() ? take / "rig.json" : options.start);
  FoundColors found;
  if (!options.takes.empty()) match_targets(options, found, stop);
  if (!options.chart.empty()) match_chart(options, rig, found, stop);
  if (!options.scene.empty()) match_scene(options, rig, found, stop);
  const std::vector<std::string>& cameras = found.cameras;
  const std::string& reference = cameras[static_cast<std::size_t>(found.reference)];
  fmt::print("{}", options.json ? color_json(found.steps, reference, cameras)
                                : color_text(found.steps, reference));
  const bool is_sure =
      std::ranges::all_of(found.steps, [](const ColorMatch& step) { return step.reasons.empty(); });
  if (!is_sure && !options.force) {
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
    camera.photometric =
        found.steps.back().responses[static_cast<std::size_t>(same - cameras.begin())];
  }
  std::vector<std::byte> sheet;  // before anything is written, as it may fail
  if (!options.sheet.empty()) {
    const Take shown(options.sheet_of.empty() ? take : options.sheet_of);
    sheet = encode_jpeg(color_sheet(shown, rig), {});
  }
  write_rig(rig, options.output);
  if (!sheet.empty()) write_file_atomically(options.sheet, sheet);
  return ExitCode::kSuccess;
}

void add_scene(CLI::App& app, ColorOptions& o, CLI::Option* takes, CLI::Option* chart) {
  const char* group = "Without a target";
  CLI::Option* const scene =
      app.add_option(
             "--scene", o.scene,
             "A take of any scene with patterned surfaces: contrast and brightness by which "
             "the cameras agree about the same places of it. Needs a rig that is "
             "calibrated; all else that it knows of colours stays")
          ->type_name("TAKE")
          ->excludes(takes)
          ->excludes(chart)
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

CLI::Option* add_chart(CLI::App& app, ColorOptions& o) {
  const char* group = "With a colour chart";
  CLI::Option* const chart =
      app.add_option(
             "--chart", o.chart,
             "A take of a ColorChecker Classic that every camera sees, held still: a matrix "
             "for each camera's colours, on top of what targets or else --start tell")
          ->type_name("TAKE")
          ->group(group);
  app.add_flag("--published", o.published,
               "Colours become what the chart is known to reflect in Rec.709 (default: what the "
               "reference camera shows), as bright as the reference camera shows the greys")
      ->needs(chart)
      ->group(group);
  return chart;
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
  app.add_flag("--flat-field", o.flat_field,
               "Likewise, as a map of what each part of a picture gains in each channel: also what "
               "no lens explains (filters, shading of a sensor), and any unevenness of the target")
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
      "Contrast and brightness of every camera and channel, and more of its colours: from targets "
      "without features, a colour chart, or a scene");
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
  CLI::Option* const chart = add_chart(*app, *o);
  add_scene(*app, *o, takes, chart);
  add_target_options(*app, *o, takes);
  CLI::Option* const sheet =
      app->add_option(
             "--sheet", o->sheet,
             "Contact sheet: what cameras show, as recorded on the left, corrected on the right")
          ->type_name("FILE.jpg");
  app->add_option("--sheet-of", o->sheet_of,
                  "The take that the sheet shows (default: the first that is given)")
      ->type_name("TAKE")
      ->needs(sheet);
  app->add_flag("--force", o->force, "Write the rig even if it cannot be vouched for");
  add_threads_option(*app, o->threads);
  app->add_flag("--json", o->json, "Print everything found as JSON");
  app->add_flag("-q,--quiet", o->quiet, "No progress on stderr");
  return {app, [o](const std::stop_token& stop) { return calibrate_color(*o, stop); }};
}

}  // namespace raystage
