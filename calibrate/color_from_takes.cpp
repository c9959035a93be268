// SPDX-License-Identifier: Apache-2.0
// Calibrates the colour of an array (thesis 4.3) in up to three steps, each of which starts from
// the result of the previous one: flat targets (flat_field_match.h), a chart (color_chart.h), the
// scene itself (scene_color.h).
#include "calibrate/color_from_takes.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "base/error.h"
#include "calibrate/color/color_chart.h"
#include "calibrate/color/flat_field_match.h"
#include "calibrate/color/response_curve.h"
#include "calibrate/color/scene_color.h"
#include "rig/rig.h"
#include "store/scene_depth_range.h"
#include "store/take.h"

namespace raystage::calibrate {
namespace {

std::vector<std::string> camera_ids(const store::Take& take) {
  std::vector<std::string> ids;
  for (const auto& camera : take.document().cameras) ids.push_back(camera.id);
  return ids;
}

int reference_index(const std::string& reference, const std::vector<std::string>& cameras) {
  if (reference.empty()) return 0;
  const auto found = std::ranges::find(cameras, reference);
  if (found == cameras.end()) {
    throw Error::bad_input("there is no camera \"" + reference + "\"", "the reference camera",
                           "Name a camera of the takes")
        .concerning({"reference"});
  }
  return static_cast<int>(found - cameras.begin());
}

/// Throws Error (bad input) if the rig has another frame size than the take.
void check_frame_sizes(const store::Take& take, const schemas::RigDocument& rig) {
  for (const schemas::RigDocument::Camera& camera : rig.cameras) {
    const schemas::CameraGeometry& in_rig = camera.geometry;
    const int index = take.camera_index(in_rig.id);
    if (index < 0) continue;  // reported by with_color_responses()
    const rig::CameraModel& model = take.rig().cameras[index].model;
    if (model.width() == in_rig.width && model.height() == in_rig.height) continue;
    throw Error::bad_input(
        fmt::format("camera \"{}\" has pictures of {}x{} pixels here, and of {}x{} in the rig",
                    in_rig.id, model.width(), model.height(), in_rig.width, in_rig.height),
        take.folder().string(), "Record with the frame size of the scene, or give its rig");
  }
}

/// Flat targets, each a take of the same cameras; the dark one is last.
struct Targets {
  std::vector<std::unique_ptr<store::Take>> takes;
  std::vector<std::string> cameras;
};

Targets open_targets(const ColorFromTakesOptions& options) {
  std::vector<std::filesystem::path> folders = options.targets;
  if (!options.dark.empty()) folders.push_back(options.dark);
  Targets targets;
  for (const std::filesystem::path& folder : folders) {
    targets.takes.push_back(std::make_unique<store::Take>(folder));
    const std::vector<std::string> ids = camera_ids(*targets.takes.back());
    if (targets.cameras.empty()) targets.cameras = ids;
    if (ids != targets.cameras) {
      throw Error::bad_input("the take has other cameras than the first", folder.string(),
                             "Record all targets with the same cameras");
    }
  }
  return targets;
}

std::vector<FlatFieldMeasurements> measure_targets(
    const Targets& targets, const std::vector<schemas::PhotometricResponse>& responses,
    const std::stop_token& stop) {
  std::vector<FlatFieldMeasurements> measurements;
  for (const auto& take : targets.takes) {
    measurements.push_back(measure_flat_fields(*take, responses, stop));
  }
  return measurements;
}

/// Throws Error (bad input) if a longer exposure is darker than a shorter one in some camera.
void check_exposures(const ColorFromTakesOptions& options, const Targets& targets,
                     const std::vector<FlatFieldMeasurements>& measurements) {
  const std::vector<double>& exposures = options.exposures;
  if (exposures.size() != options.targets.size()) {
    throw Error::bad_input(fmt::format("there are {} exposures for {} takes", exposures.size(),
                                       options.targets.size()),
                           "the exposures",
                           "Give the exposure of each take, in the order of the takes")
        .concerning({"exposures"});
  }
  for (std::size_t a = 0; a < exposures.size(); ++a) {
    for (std::size_t b = 0; b < exposures.size(); ++b) {
      if (!(exposures[a] < exposures[b])) continue;
      for (std::size_t c = 0; c < targets.cameras.size(); ++c) {
        const bool is_consistent = measurements[a][c].mean[1] < measurements[b][c].mean[1] ||
                                   measurements[a][c].clipped > 0;
        if (is_consistent) continue;
        throw Error::bad_input(
            fmt::format("camera \"{}\" shows {} darker than {}, although its exposure is longer",
                        targets.cameras[c], options.targets[b].string(),
                        options.targets[a].string()),
            "the exposures", "Give the exposure of each take, in the order of the takes")
            .concerning({"exposures"});
      }
    }
  }
}

/// Removes exposures that some camera clips: they served the response curve only.
void remove_overexposed(std::vector<FlatFieldMeasurements>& measurements) {
  constexpr double kMaxClipped = 0.01;
  const auto is_overexposed = [](const FlatFieldMeasurements& target) {
    return std::ranges::any_of(target, [](const FlatFieldMeasurement& measurement) {
      return measurement.clipped > kMaxClipped;
    });
  };
  if (std::ranges::all_of(measurements, is_overexposed)) return;  // match_flat_fields() rejects it
  std::erase_if(measurements, is_overexposed);
}

void match_targets(const ColorFromTakesOptions& options, const schemas::RigDocument& rig,
                   ColorFromTakes& found, const std::stop_token& stop) {
  const Targets targets = open_targets(options);
  for (const auto& take : targets.takes) check_frame_sizes(*take, rig);
  found.cameras = targets.cameras;
  found.reference = reference_index(options.reference, targets.cameras);
  FlatFieldMatchOptions match;
  match.reference = found.reference;
  match.neutral = options.neutral;
  match.vignetting = options.vignetting;
  match.flat_field = options.flat_field;
  match.dark = !options.dark.empty();
  std::vector<FlatFieldMeasurements> measurements = measure_targets(targets, {}, stop);
  if (!options.exposures.empty()) {
    check_exposures(options, targets, measurements);
    match.curves = fit_response_curves(measurements, options.exposures,
                                       match.dark ? &measurements.back() : nullptr,
                                       targets.takes.front()->document().color_space);
    measurements = measure_targets(targets, match.curves, stop);
    remove_overexposed(measurements);
  }
  found.steps.push_back(match_flat_fields(measurements, targets.cameras, match));
}

/// Returns the rig with its cameras in the order of `cameras`.
schemas::RigDocument reordered_rig(const std::vector<std::string>& cameras,
                                   const schemas::RigDocument& rig,
                                   const std::filesystem::path& rig_file) {
  schemas::RigDocument ordered = rig;
  ordered.cameras.clear();
  for (const std::string& id : cameras) {
    const schemas::RigDocument::Camera* same = rig.find(id);
    if (same == nullptr) {
      throw Error::bad_input("the rig has no camera \"" + id + "\"", rig_file.string(),
                             "Give the rig of the take's cameras")
          .concerning({"initial_rig"});
    }
    ordered.cameras.push_back(*same);
  }
  return ordered;
}

/// Refines the responses of the targets, or else those of the rig.
void match_chart(const ColorFromTakesOptions& options, const schemas::RigDocument& rig,
                 const std::filesystem::path& rig_file, ColorFromTakes& found,
                 const std::stop_token& stop) {
  const store::Take take(options.chart);
  check_frame_sizes(take, rig);
  std::vector<schemas::PhotometricResponse> responses;
  if (found.steps.empty()) {
    found.cameras = camera_ids(take);
    found.reference = reference_index(options.reference, found.cameras);
    for (const auto& camera : reordered_rig(found.cameras, rig, rig_file).cameras) {
      responses.push_back(camera.photometric);
    }
  } else {
    responses = found.steps.back().responses;
    if (camera_ids(take) != found.cameras) {
      throw Error::bad_input("the take has other cameras than the targets", options.chart.string(),
                             "Record the chart with the same cameras");
    }
  }
  found.steps.push_back(match_charts(measure_charts(take, responses, stop), responses,
                                     found.cameras,
                                     {found.reference, options.use_published_values}));
}

schemas::DepthRange search_depths(const ColorFromTakesOptions& options, const store::Take& take) {
  constexpr double kTolerance = 1.1;
  if (options.focal_depth > 0) {
    return {options.focal_depth / kTolerance, options.focal_depth * kTolerance};
  }
  try {
    return store::scene_depth_range(
        take, options.depths, "matching colours",
        "Give the nearest and the farthest depth, or the depth of the focal "
        "plane, in metres in front of the array");
  } catch (const Error& error) {
    throw error.concerning({"near", "far", "focal_depth"});
  }
}

void match_scene(const ColorFromTakesOptions& options, const schemas::RigDocument& document,
                 const std::filesystem::path& rig_file, ColorFromTakes& found,
                 const std::function<void(double)>& progress, const std::stop_token& stop) {
  const store::Take take(options.scene);
  check_frame_sizes(take, document);
  if (!schemas::is_calibrated(document)) {
    throw Error::bad_input("the rig has no camera poses", rig_file.string(),
                           "Calibrate its geometry first (`raystage calibrate geometry`)");
  }
  found.cameras = camera_ids(take);
  found.reference = reference_index(options.reference, found.cameras);
  const rig::Rig rig = rig::rig_from_document(reordered_rig(found.cameras, document, rig_file));
  PatchSearchOptions search;
  search.depths = search_depths(options, take);
  const std::vector<ScenePatch> patches = find_scene_patches(take, rig, search, progress, stop);
  found.steps.push_back(match_scene_colors(patches, rig, found.reference, stop));
}

}  // namespace

bool ColorFromTakes::is_accepted() const {
  return std::ranges::all_of(steps, [](const ColorMatch& step) { return step.reasons.empty(); });
}

ColorFromTakes calibrate_color(const ColorFromTakesOptions& options,
                               const schemas::RigDocument& rig,
                               const std::filesystem::path& rig_file,
                               const std::function<void(double)>& progress,
                               const std::stop_token& stop) {
  ColorFromTakes found;
  if (!options.targets.empty()) match_targets(options, rig, found, stop);
  if (!options.chart.empty()) match_chart(options, rig, rig_file, found, stop);
  if (!options.scene.empty()) match_scene(options, rig, rig_file, found, progress, stop);
  if (found.steps.empty()) {
    throw Error::bad_input("there is neither a target, a chart nor a scene",
                           "the calibration of colours",
                           "Give takes of targets, of a chart or of "
                           "a scene")
        .concerning({"chart", "scene"});
  }
  return found;
}

schemas::RigDocument with_color_responses(schemas::RigDocument rig,
                                          const std::filesystem::path& rig_file,
                                          const ColorFromTakes& found) {
  for (schemas::RigDocument::Camera& camera : rig.cameras) {
    const auto same = std::ranges::find(found.cameras, camera.geometry.id);
    if (same == found.cameras.end()) {
      throw Error::bad_input("the takes have no camera \"" + camera.geometry.id + "\"",
                             rig_file.string(), "Give the rig of the same cameras");
    }
    camera.photometric = found.steps.back().responses[same - found.cameras.begin()];
  }
  return rig;
}

}  // namespace raystage::calibrate
