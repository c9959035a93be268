// SPDX-License-Identifier: Apache-2.0
// Solves an array. Initial poses are computed for the given field of view, or for seven trial
// values on a subset of the points. Each is tried with a tolerant and a strict inlier threshold in
// parallel. The best result (most cameras, then most fitting observations) goes on to the bundle
// adjustment steps (solve_steps.h). Input: detections, pixels; output: poses, lenses, points up to
// a similarity. Cost: up to 16 initial solves plus the final bundle adjustments.
#include "calibrate/geometry/solve.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "calibrate/geometry/initial_poses.h"
#include "calibrate/geometry/solve_steps.h"
#include "calibrate/geometry/triangulation.h"

namespace raystage::calibrate {
namespace {

constexpr double kFirstError = 12;  // pixels: tolerance while lenses are unknown
constexpr double kStrict = 3;       // pixels: possible error of a bright spot's centre

/// Returns the score of a solve: number of cameras first, then fitting observations.
double score_of(const ArrayModel& model) {
  constexpr double kGood = 2;  // pixels
  double sum = count_registered_cameras(model) * 1e6;
  for (const double error : reprojection_errors(model))
    sum += 1 / (1 + error * error / (kGood * kGood));
  return sum;
}

/// Computes initial poses, or starts from known ones; inliers are within `max_error_px`.
ArrayModel begun_once(const ArrayModel& empty, double max_error_px, const SolveOptions& options) {
  ArrayModel model = empty;
  BundleAdjustmentOptions bundle;
  bundle.fixed_cameras = options.fixed_cameras;
  bundle.stop = options.stop;
  bundle.loss_scale_px = 2;
  InitialPosesOptions first{max_error_px, false, options.fixed_cameras};
  first.stop = options.stop;
  first.estimates_focal_lengths = options.lens_per_camera && options.lenses.empty();
  const auto is_known = [](const std::optional<rig::Pose>& pose) { return pose.has_value(); };
  if (std::ranges::count_if(options.poses, is_known) >= 2) {
    for (std::size_t i = 0; i < options.poses.size(); ++i) {
      model.cameras[i].pose = options.poses[i];
    }
    triangulate_points(model, max_error_px);
    register_cameras(model, first);
  } else if (!estimate_initial_poses(model, first)) {
    return model;
  }
  if (!options.lens_is_known && options.lenses.empty()) bundle.lens = LensRefinement::kFocalLength;
  bundle.shared_lens = !options.lens_per_camera;
  run_bundle_adjustment(model, bundle);
  if (options.lens_per_camera) register_cameras(model, first);
  return model;
}

/// Returns the best initial model of all fields of view, each with a tolerant and a strict inlier
/// threshold. The tolerant one is needed while lenses are unknown, but can hide a wrong
/// initialisation. All run in parallel; the result does not depend on their order.
ArrayModel begun_with(const Detections& detections, const std::vector<double>& fovs,
                      const SolveOptions& options) {
  std::vector<ArrayModel> begun(2 * fovs.size());
  parallel_for(std::size_t{0}, begun.size(), [&](std::size_t i) {
    ArrayModel model = make_initial_model(detections, fovs[i / 2], options.lens_models);
    for (std::size_t k = 0; k < options.lenses.size(); ++k) {
      model.cameras[k].intrinsics = options.lenses[k];
    }
    begun[i] = begun_once(model, i % 2 == 0 ? kFirstError : kStrict, options);
  });
  return std::move(*std::ranges::max_element(begun, {}, score_of));
}

/// Returns at most `max_points` points, evenly spread, in the cameras with the most detections.
Detections thinned(const Detections& all, std::size_t max_points, std::size_t most_cameras) {
  std::vector<int> points;
  std::vector<std::pair<int, int>> sights;  // number of detections and camera
  for (std::size_t i = 0; i < all.cameras.size(); ++i) sights.emplace_back(0, static_cast<int>(i));
  for (const auto& d : all.detections) {
    if (points.empty() || points.back() != d.point) points.push_back(d.point);
    ++sights[d.camera].first;
  }
  std::ranges::stable_sort(sights, std::greater<>(), [](const auto& sight) { return sight.first; });
  std::vector<bool> looks(all.cameras.size(), false);
  for (std::size_t i = 0; i < std::min(most_cameras, sights.size()); ++i) {
    looks[sights[i].second] = true;
  }
  const std::size_t step = (points.size() + max_points - 1) / max_points;
  Detections thin{all.cameras, {}};
  std::size_t index = 0;
  for (const auto& d : all.detections) {
    while (points[index] != d.point) ++index;
    if (index % step == 0 && looks[d.camera]) thin.detections.push_back(d);
  }
  return thin;
}

/// Returns the given field of view, or the trial value with which most cameras and points fit.
double likely_fov(const Detections& detections, const SolveOptions& options) {
  constexpr double kDegree = std::numbers::pi / 180;
  if (options.horizontal_fov) return *options.horizontal_fov;
  if (!options.lenses.empty()) return 60 * kDegree;  // unused
  constexpr std::size_t kMaxPoints = 150, kMaxCameras = 9;
  const Detections thin = thinned(detections, kMaxPoints, kMaxCameras);
  const ArrayModel best = begun_with(thin, trial_fovs(options.lens_models), options);
  const auto found = std::ranges::find_if(
      best.cameras, [](const ArrayModel::Camera& camera) { return camera.pose.has_value(); });
  if (found == best.cameras.end()) return 60 * kDegree;
  return horizontal_fov(found->intrinsics, found->width);
}

}  // namespace

ArrayModel solve_array(const Detections& detections, const SolveOptions& options,
                       SolveReport& report) {
  const Stopwatch watch;
  ArrayModel model = begun_with(detections, {likely_fov(detections, options)}, options);
  const bool is_held =
      std::ranges::find(options.fixed_cameras, true) != options.fixed_cameras.end();
  if (!options.poses.empty() && !is_held &&
      2 * make_solve_step(model, "").observations < static_cast<int>(model.observations.size())) {
    SolveOptions without_poses = options;  // the array has changed
    without_poses.poses.clear();
    ArrayModel anew = begun_with(detections, {likely_fov(detections, options)}, without_poses);
    if (score_of(anew) > score_of(model)) model = std::move(anew);
  }
  if (count_registered_cameras(model) < 2) {
    throw Error::bad_input("no two cameras see enough common points at different positions", "",
                           "Record the light where several cameras see it at once, near and far");
  }
  run_bundle_adjustment_steps(model, options, report);
  report.status = RunStatus::kFinished;
  report.seconds = watch.seconds();
  return model;
}

}  // namespace raystage::calibrate
