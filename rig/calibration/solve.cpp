// SPDX-License-Identifier: Apache-2.0
#include "rig/calibration/solve.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>

#include "rig/calibration/bundle.h"
#include "rig/calibration/first_poses.h"
#include "schemas/error.h"

namespace raystage {
namespace {

constexpr double kFirstError = 12;     // pixels: as much may be wrong while lenses are guessed
constexpr double kLeastThreshold = 3;  // pixels: what a bright spot's middle may be off by

/// Pixels beyond which an observation is none of the others' kind: six times the deviation that
/// their median tells (lengths of errors in two directions).
double outlier_threshold(const ArrayModel& model) {
  std::vector<double> errors = errors_of(model);
  if (errors.empty()) return kFirstError;
  const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
  std::ranges::nth_element(errors, middle);
  const double deviation = *middle / std::sqrt(2 * std::numbers::ln2);
  return std::clamp(6 * deviation, kLeastThreshold, kFirstError);
}

int placed_in(const ArrayModel& model) {
  return static_cast<int>(std::ranges::count_if(
      model.cameras, [](const ArrayModel::Camera& camera) { return camera.pose.has_value(); }));
}

SolveReport::Step step_of(const ArrayModel& model, std::string what) {
  SolveReport::Step step{std::move(what), rms_of(model), 0, 0};
  for (const ArrayModel::Observation& observation : model.observations) {
    if (model.counts(observation)) ++step.observations;
    if (observation.is_outlier) ++step.outliers;
  }
  return step;
}

/// Until observations stay on their side. `least_px`: what the lens as it is then may err by is no
/// reason to drop one.
void settle(ArrayModel& model, const BundleSettings& settings, double least_px) {
  constexpr int kMostRounds = 6;
  for (int round = 0; round < kMostRounds; ++round) {
    adjust(model, settings);
    const double threshold = std::max(outlier_threshold(model), least_px);
    triangulate(model, threshold);
    const int changed = sort_outliers(model, threshold);
    if (changed <= static_cast<int>(model.observations.size() / 1000)) break;
  }
  adjust(model, settings);
}

ArrayModel begun_with(const Detections& detections, double fov, const SolveSettings& settings) {
  ArrayModel model = model_of(detections, fov);
  for (std::size_t i = 0; i < settings.lenses.size(); ++i) {
    model.cameras[i].intrinsics = settings.lenses[i];
  }
  if (!find_first_poses(model, {kFirstError, settings.threads})) return model;
  BundleSettings bundle;
  bundle.threads = settings.threads;
  bundle.loss_px = 2;
  if (!settings.lens_is_known && settings.lenses.empty()) bundle.lens = LensFreedom::kFocalLength;
  adjust(model, bundle);
  return model;
}

/// The more cameras, then the more observations and the less error, the better.
double score_of(const ArrayModel& model) {
  const SolveReport::Step step = step_of(model, "");
  if (step.observations == 0) return 0;
  return placed_in(model) * 1e6 + step.observations / (1 + step.rms_px);
}

}  // namespace

ArrayModel solve_array(const Detections& detections, const SolveSettings& settings,
                       SolveReport& report) {
  const auto start = std::chrono::steady_clock::now();
  constexpr double kDegree = std::numbers::pi / 180;
  std::vector<double> tried{40 * kDegree, 55 * kDegree, 70 * kDegree, 90 * kDegree};
  if (settings.horizontal_fov) tried = {*settings.horizontal_fov};
  if (!settings.lenses.empty()) tried.resize(1);
  ArrayModel model;
  for (const double fov : tried) {
    ArrayModel begun = begun_with(detections, fov, settings);
    if (model.cameras.empty() || score_of(begun) > score_of(model)) model = std::move(begun);
  }
  if (placed_in(model) < 2) {
    throw Error::bad_input("no two cameras see enough of the same points in places that differ", "",
                           "Record the light where several cameras see it at once, near and far");
  }
  BundleSettings bundle;
  bundle.threads = settings.threads;
  const auto release = [&](LensFreedom lens, bool shared, double least_px, const char* what) {
    bundle.lens = lens;
    bundle.shared_lens = shared;
    settle(model, bundle, least_px);
    report.steps.push_back(step_of(model, what));
  };
  const bool frees = !settings.lens_is_known;
  release(LensFreedom::kNone, false, frees ? 8 : kLeastThreshold, "poses and points");
  if (frees && settings.lenses.empty()) {
    release(LensFreedom::kFocalLength, true, 8, "one focal length for all");
    release(LensFreedom::kRadial, true, settings.lens_per_camera ? 8 : kLeastThreshold,
            "one lens for all");
  }
  if (frees && settings.lens_per_camera) {
    release(LensFreedom::kPinhole, false, 4, "a focal length and a middle for each camera");
    release(LensFreedom::kRadial, false, 4, "a lens for each camera");
  }
  if (frees && settings.whole_lens_model) {
    release(LensFreedom::kWholeModel, !settings.lens_per_camera, 4, "all of the lens model");
  }
  if (frees && (settings.lens_per_camera || settings.whole_lens_model)) {
    release(bundle.lens, bundle.shared_lens, kLeastThreshold, "without what is still odd");
  }
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return model;
}

}  // namespace raystage
