// SPDX-License-Identifier: Apache-2.0
#include "rig/calibration/solve_steps.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "rig/calibration/bundle.h"
#include "rig/calibration/first_poses.h"

namespace raystage {
namespace {

constexpr double kMostThreshold = 12;  // pixels
constexpr double kLeastThreshold = 3;

/// Pixels beyond which an observation is none of the others' kind: six times the deviation that
/// their median tells (lengths of errors in two directions).
double outlier_threshold(const ArrayModel& model) {
  std::vector<double> errors = errors_of(model);
  if (errors.empty()) return kMostThreshold;
  const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
  std::ranges::nth_element(errors, middle);
  const double deviation = *middle / std::sqrt(2 * std::numbers::ln2);
  return std::clamp(6 * deviation, kLeastThreshold, kMostThreshold);
}

/// Until observations stay on their side. `least_px`: what the lens as it is then may err by is no
/// reason to drop one.
void settle(ArrayModel& model, const BundleSettings& settings, double least_px) {
  constexpr int kMostRounds = 6;
  for (int round = 0; round < kMostRounds; ++round) {
    adjust(model, settings);
    const double threshold = std::max(outlier_threshold(model), least_px);
    if (model.bodies.empty()) triangulate(model, threshold);
    const int changed = sort_outliers(model, threshold);
    if (changed <= static_cast<int>(model.observations.size() / 1000)) break;
  }
  adjust(model, settings);
}

}  // namespace

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

void run_steps(ArrayModel& model, const SolveSettings& settings, SolveReport& report) {
  BundleSettings bundle;
  bundle.held_cameras = settings.held_cameras;
  bundle.stop = settings.stop;
  const auto release = [&](LensFreedom lens, bool shared, double least_px, const char* what) {
    bundle.lens = lens;
    bundle.shared_lens = shared;
    settle(model, bundle, least_px);
    report.steps.push_back(step_of(model, what));
    if (settings.on_step) settings.on_step(report.steps.back());
  };
  const bool frees = !settings.lens_is_known, each = settings.lens_per_camera;
  release(LensFreedom::kNone, false, frees ? 8 : kLeastThreshold, "poses and points");
  if (frees && settings.lenses.empty()) {
    release(LensFreedom::kFocalLength, !each, 8,
            each ? "a focal length for each camera" : "one focal length for all");
  }
  if (frees && !each) {
    release(LensFreedom::kRadial, true, kLeastThreshold, "one lens for all");
  }
  if (frees && each) {
    release(LensFreedom::kPinhole, false, 4, "a principal point for each camera");
    release(LensFreedom::kRadial, false, 4, "a lens for each camera");
  }
  if (frees && settings.whole_lens_model) {
    release(LensFreedom::kWholeModel, !each, 4, "all of the lens model");
  }
  if (frees && (each || settings.whole_lens_model)) {
    release(bundle.lens, bundle.shared_lens, kLeastThreshold, "without what is still odd");
  }
  report.last = bundle;
}

}  // namespace raystage
