// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "calibrate/color/color_chart.h"
#include "calibrate/color/color_contact_sheet.h"
#include "calibrate/color/flat_field_match.h"
#include "calibrate/color/response_curve.h"
#include "calibrate/color/scene_color.h"
#include "cli/calibrate.h"
#include "cli/calibrate_color_options.h"
#include "cli/threads.h"
#include "rig/rig.h"
#include "schemas/rig_document.h"
#include "store/jpeg/encode.h"
#include "store/scene_depth_range.h"

namespace raystage {
namespace {

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

Targets open_targets(const CalibrateColorOptions& options) {
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
std::vector<FlatFieldMeasurements> sights_of(const Targets& targets,
                                             const std::vector<PhotometricResponse>& responses,
                                             const std::stop_token& stop) {
  std::vector<FlatFieldMeasurements> measurements;
  for (const auto& take : targets.takes)
    measurements.push_back(measure_flat_fields(*take, responses, stop));
  return measurements;
}

std::vector<PhotometricResponse> curves_of(const CalibrateColorOptions& options,
                                           const Targets& targets,
                                           const std::vector<FlatFieldMeasurements>& measurements) {
  if (options.exposures.size() != options.takes.size()) {
    throw Error::bad_input(fmt::format("there are {} exposures for {} takes",
                                       options.exposures.size(), options.takes.size()),
                           "--exposures", "Give each take's, in their order");
  }
  // A longer exposure is brighter, or they are in another order.
  for (std::size_t a = 0; a < options.exposures.size(); ++a) {
    for (std::size_t b = 0; b < options.exposures.size(); ++b) {
      if (!(options.exposures[a] < options.exposures[b])) continue;
      for (std::size_t c = 0; c < targets.cameras.size(); ++c) {
        if (measurements[a][c].mean[1] < measurements[b][c].mean[1] ||
            measurements[a][c].clipped > 0)
          continue;
        throw Error::bad_input(
            fmt::format("camera \"{}\" shows {} darker than {}, which is said to be exposed for "
                        "less long",
                        targets.cameras[c], options.takes[b].string(), options.takes[a].string()),
            "--exposures", "Give each take's exposure, in the order of the takes");
      }
    }
  }
  return fit_response_curves(measurements, options.exposures,
                             options.dark.empty() ? nullptr : &measurements.back(),
                             targets.takes.front()->document().color_space);
}

/// Leaves exposures out that are too long for some camera: what they are for is the curve.
void leave_out_overexposed(std::vector<FlatFieldMeasurements>& measurements) {
  constexpr double kClipped = 0.01;
  const auto is_overexposed = [](const FlatFieldMeasurements& target) {
    return std::ranges::any_of(target, [](const FlatFieldMeasurement& measurement) {
      return measurement.clipped > kClipped;
    });
  };
  if (std::ranges::all_of(measurements, is_overexposed)) return;  // said where colours are matched
  std::erase_if(measurements, is_overexposed);
}

/// What was found about which cameras.
struct FoundColors {
  std::vector<std::string> cameras;  ///< their ids
  int reference = 0;                 ///< one of them
  std::vector<ColorMatch> steps;     ///< each on top of the one before
};

int reference_of(const CalibrateColorOptions& options, const std::vector<std::string>& cameras) {
  if (options.reference.empty()) return 0;
  const auto found = std::ranges::find(cameras, options.reference);
  if (found == cameras.end()) {
    throw Error::bad_input("there is no camera \"" + options.reference + "\"", "--reference",
                           "Name a camera of the takes");
  }
  return static_cast<int>(found - cameras.begin());
}

/// Throws Error (bad input) where the rig is of other pictures than a take's.
void check_sizes(const Take& take, const RigDocument& rig) {
  for (const RigDocument::Camera& camera : rig.cameras) {
    const CameraGeometry& in_rig = camera.geometry;
    const int index = take.camera_index(in_rig.id);
    if (index < 0) continue;  // said elsewhere
    const CameraModel& model = take.rig().cameras[static_cast<std::size_t>(index)].model;
    if (model.width() == in_rig.width && model.height() == in_rig.height) continue;
    throw Error::bad_input(
        fmt::format("camera \"{}\" has pictures of {}x{} pixels here, and of {}x{} in the rig",
                    in_rig.id, model.width(), model.height(), in_rig.width, in_rig.height),
        take.folder().string(), "Record with the frame size of the scene, or give its rig");
  }
}

void match_targets(const CalibrateColorOptions& options, const RigDocument& document,
                   FoundColors& found, const std::stop_token& stop) {
  const Targets targets = open_targets(options);
  for (const auto& take : targets.takes) check_sizes(*take, document);
  found.cameras = targets.cameras;
  found.reference = reference_of(options, targets.cameras);
  FlatFieldMatchSettings settings;
  settings.reference = found.reference;
  settings.neutral = options.neutral;
  settings.vignetting = options.vignetting;
  settings.flat_field = options.flat_field;
  settings.dark = !options.dark.empty();
  std::vector<FlatFieldMeasurements> measurements = sights_of(targets, {}, stop);
  if (!options.exposures.empty()) {
    settings.curves = curves_of(options, targets, measurements);
    measurements = sights_of(targets, settings.curves, stop);
    leave_out_overexposed(measurements);
  }
  found.steps.push_back(match_flat_fields(measurements, targets.cameras, settings));
}

/// The rig with its cameras as the take has them.
RigDocument in_order_of(const std::vector<std::string>& cameras, const RigDocument& document,
                        const CalibrateColorOptions& options) {
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
void match_chart(const CalibrateColorOptions& options, const RigDocument& document,
                 FoundColors& found, const std::stop_token& stop) {
  const Take take(options.chart);
  check_sizes(take, document);
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
  found.steps.push_back(match_charts(measure_charts(take, responses, stop), responses,
                                     found.cameras,
                                     {found.reference, options.use_published_values}));
}

/// The depths of --focal-depth, to a tenth of it, or of --near and --far, or as the take says.
DepthRange depths_of(const CalibrateColorOptions& options, const Take& take) {
  constexpr double kAround = 1.1;
  if (options.focal_depth > 0) {
    return {options.focal_depth / kAround, options.focal_depth * kAround};
  }
  return scene_depth_range(
      take, {options.near, options.far}, "matching colours",
      "Give --near and --far, or --focal-depth, in metres in front of the array");
}

void match_scene(const CalibrateColorOptions& options, const RigDocument& document,
                 FoundColors& found, const std::stop_token& stop) {
  const Take take(options.scene);
  check_sizes(take, document);
  if (!is_calibrated(document)) {
    throw Error::bad_input("the rig does not know where the cameras stand",
                           options.start.empty() ? "rig.json" : options.start.string(),
                           "Calibrate its geometry first (raystage calibrate geometry)");
  }
  found.cameras = ids_of(take);
  found.reference = reference_of(options, found.cameras);
  const Rig rig = rig_from_document(in_order_of(found.cameras, document, options));
  PatchSearchSettings settings;
  settings.depths = depths_of(options, take);
  Progress progress(!options.quiet);
  const std::vector<ScenePatch> points = find_scene_patches(
      take, rig, settings, [&](double done) { progress.report(done); }, stop);
  found.steps.push_back(match_scene_colors(points, rig, found.reference, stop));
}

/// The take that shows what is looked at first.
const std::filesystem::path& first_take(const CalibrateColorOptions& options) {
  if (!options.takes.empty()) return options.takes.front();
  const auto& take = options.chart.empty() ? options.scene : options.chart;
  if (take.empty()) {
    throw Error::bad_input("there is neither a target nor a scene", "calibrate color",
                           "Give takes of targets, --chart TAKE or --scene TAKE");
  }
  return take;
}

ExitCode calibrate_color(const CalibrateColorOptions& options, const std::stop_token& stop) {
  const ThreadLimit limit(options.threads);
  const std::filesystem::path& take = first_take(options);
  check_writable(options.output);
  if (!options.sheet.empty()) check_writable(options.sheet);
  RigDocument rig = read_rig(options.start.empty() ? take / "rig.json" : options.start);
  FoundColors found;
  if (!options.takes.empty()) match_targets(options, rig, found, stop);
  if (!options.chart.empty()) match_chart(options, rig, found, stop);
  if (!options.scene.empty()) match_scene(options, rig, found, stop);
  const std::vector<std::string>& cameras = found.cameras;
  const std::string& reference = cameras[static_cast<std::size_t>(found.reference)];
  fmt::print("{}", options.json ? color_match_json(found.steps, reference, cameras)
                                : format_color_match(found.steps, reference));
  const bool is_sure =
      std::ranges::all_of(found.steps, [](const ColorMatch& step) { return step.reasons.empty(); });
  if (!is_sure && !options.force) {
    throw Error::failed(
        "the rig was not written: the colour calibration was rejected (see \"Not sure\")",
        options.output.string(), "Use --force to write it anyway");
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
    sheet = encode_jpeg(make_color_contact_sheet(shown, rig), {});
  }
  if (!sheet.empty()) write_file_atomically(options.sheet, sheet);
  write_rig(rig, options.output);
  return ExitCode::kSuccess;
}

}  // namespace

CalibrateCommand declare_calibrate_color(CLI::App& calibrate) {
  auto o = std::make_shared<CalibrateColorOptions>();
  CLI::App* app = calibrate.add_subcommand(
      "color",
      "Contrast and brightness of every camera and channel, and more of its colours: from targets "
      "without features, a colour chart, or a scene");
  add_calibrate_color_options(*app, *o);
  return {app, [o](const std::stop_token& stop) { return calibrate_color(*o, stop); }};
}

}  // namespace raystage
