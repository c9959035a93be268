// SPDX-License-Identifier: Apache-2.0
// Bundle adjustment steps of a solve: poses and points first, then focal lengths, principal points,
// radial distortion and, on request, the full lens model. Lenses are shared by all cameras or one
// per camera. Each step alternates bundle adjustment and outlier classification until at most 0.1 %
// of the observations change, in at most 6 rounds. The outlier threshold is six times the standard
// deviation that the median error implies, 3 to 12 pixels.
#include "calibrate/geometry/solve_steps.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "calibrate/geometry/bundle_adjustment.h"
#include "calibrate/geometry/median.h"
#include "calibrate/geometry/triangulation.h"

namespace raystage::calibrate {
namespace {

constexpr double kMaxThreshold = 12;  // pixels
constexpr double kMinThreshold = 3;

/// Returns the outlier threshold, pixels: six times the standard deviation that the median error
/// implies (errors are lengths in two dimensions).
double outlier_threshold(const ArrayModel& model) {
  std::vector<double> errors = reprojection_errors(model);
  if (errors.empty()) return kMaxThreshold;

  const double deviation = median(std::move(errors)) / std::sqrt(2 * std::numbers::ln2);
  return std::clamp(6 * deviation, kMinThreshold, kMaxThreshold);
}

/// Alternates bundle adjustment and outlier classification until few observations change.
/// `least_px`: smallest threshold, the possible error of the current lens model.
void adjust_without_outliers(ArrayModel& model, const BundleAdjustmentOptions& options,
                             double least_px) {
  constexpr int kMaxRounds = 6;
  for (int round = 0; round < kMaxRounds; ++round) {
    run_bundle_adjustment(model, options);
    const double threshold = std::max(outlier_threshold(model), least_px);
    if (model.bodies.empty()) triangulate_points(model, threshold);
    const int changed = classify_outliers(model, threshold);
    if (changed <= static_cast<int>(model.observations.size() / 1000)) break;
  }
  run_bundle_adjustment(model, options);
}

}  // namespace

int count_registered_cameras(const ArrayModel& model) {
  return static_cast<int>(std::ranges::count_if(
      model.cameras, [](const ArrayModel::Camera& camera) { return camera.pose.has_value(); }));
}

SolveReport::Step make_solve_step(const ArrayModel& model, std::string what) {
  SolveReport::Step step{std::move(what), rms_reprojection_error(model), 0, 0};
  for (const ArrayModel::Observation& observation : model.observations) {
    if (model.counts(observation)) ++step.observations;
    if (observation.is_outlier) ++step.outliers;
  }
  return step;
}

void run_bundle_adjustment_steps(ArrayModel& model, const SolveOptions& options,
                                 SolveReport& report) {
  BundleAdjustmentOptions bundle;
  bundle.fixed_cameras = options.fixed_cameras;
  bundle.stop = options.stop;
  const auto release = [&](LensRefinement lens, bool shared, double least_px, const char* what) {
    bundle.lens = lens;
    bundle.shared_lens = shared;
    adjust_without_outliers(model, bundle, least_px);
    report.steps.push_back(make_solve_step(model, what));
    if (options.on_step) options.on_step(report.steps.back());
  };
  const bool frees = !options.lens_is_known, each = options.lens_per_camera;
  release(LensRefinement::kNone, false, frees ? 8 : kMinThreshold, "poses and points");
  if (frees && options.lenses.empty()) {
    release(LensRefinement::kFocalLength, !each, 8,
            each ? "a focal length for each camera" : "one focal length for all");
  }
  if (frees && !each) release(LensRefinement::kRadial, true, kMinThreshold, "one lens for all");
  if (frees && each) {
    release(LensRefinement::kPinhole, false, 4, "a principal point for each camera");
    release(LensRefinement::kRadial, false, 4, "a lens for each camera");
  }
  if (frees && options.full_lens_model) {
    release(LensRefinement::kFullModel, !each, 4, "full lens model");
  }
  if (frees && (each || options.full_lens_model)) {
    release(bundle.lens, bundle.shared_lens, kMinThreshold, "without remaining outliers");
  }
  report.last = bundle;
}

}  // namespace raystage::calibrate
