// SPDX-License-Identifier: Apache-2.0
// Incremental structure from motion. The initial pair has the camera with the most observations and
// the one with the best product of inliers (essential matrix, RANSAC) and median angle between
// rays. Other cameras follow by perspective-n-point with RANSAC, the one with the most known points
// first; bundle adjustments run whenever the array has grown by half. Inputs: pixels; output: poses
// up to scale. Cost: cameras times points, plus bundle adjustments.
#include "calibrate/geometry/initial_poses.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "base/error.h"
#include "base/options.h"
#include "calibrate/geometry/bundle_adjustment.h"
#include "calibrate/geometry/median.h"
#include "calibrate/geometry/opencv_pose.h"
#include "calibrate/geometry/ray_view.h"
#include "calibrate/geometry/triangulation.h"
#include "rig/camera_model.h"

namespace raystage::calibrate {
namespace {

using Eigen::Vector3d;

constexpr int kMinCommon = 12;  // common points of the initial pair
constexpr int kMinKnown = 6;    // known points that a camera must observe to be registered
constexpr double kSure = 0.9999;

/// Returns the change of camera axes from ours (look along -z, y up) to OpenCV's (along z, y down).
cv::Mat opencv_from_ours() { return cv::Mat::diag(cv::Mat(cv::Vec3d(1, -1, -1))); }

/// The rays of a camera's observations, by point.
struct CameraObservations {
  rig::CameraModel lens;
  std::map<int, Vector3d> rays;           // in the camera, of CameraModel::unproject()
  std::map<int, Eigen::Vector2d> pixels;  // as many
};

std::vector<CameraObservations> observations_by_camera(const ArrayModel& model) {
  const CameraModels lenses = camera_models(model);
  std::vector<CameraObservations> observations;
  for (std::size_t c = 0; c < model.cameras.size(); ++c) {
    observations.push_back({lenses[c], {}, {}});
  }
  for (const ArrayModel::Observation& observation : model.observations) {
    const auto ray = lenses[observation.camera].unproject(observation.pixel);
    if (!ray) continue;
    observations[observation.camera].rays[observation.point] = *ray;
    observations[observation.camera].pixels[observation.point] = observation.pixel;
  }
  return observations;
}

/// Returns the image point of an ideal one for OpenCV.
cv::Point2d opencv_point(const Eigen::Vector2d& ideal) { return {ideal.x(), ideal.y()}; }

/// A second camera relative to a first one.
struct Pair {
  int first = -1, second = -1;
  rig::Pose second_pose;
  double score = 0;
};

/// Returns the largest error of an inlier on the ideal image plane: half of the reprojection error
/// that `options` allow, by the camera's own focal length.
double inlier_threshold(const rig::CameraModel& lens, const InitialPosesOptions& options) {
  return options.max_error_px / 2 * (1 / lens.intrinsics().fx);
}

/// Rates two cameras as the initial pair: inliers times the angle between their rays. The essential
/// matrix is tested by the Sampson distance, whose standard deviation is the root mean square of
/// those in the two images, as far as the epipolar constraint has gradients of one length in both.
Pair score_pair(const std::vector<CameraObservations>& observations, int first, int second,
                const InitialPosesOptions& options) {
  const CameraObservations &a = observations[first], &b = observations[second];
  std::vector<Vector3d> from_rays, to_rays;
  for (const auto& [point, ray] : a.rays) {
    const auto other = b.rays.find(point);
    if (other == b.rays.end()) continue;
    from_rays.push_back(ray);
    to_rays.push_back(other->second);
  }
  const RayView from_view(a.lens, from_rays), to_view(b.lens, to_rays);
  std::vector<cv::Point2d> from, to;
  for (std::size_t i = 0; i < from_rays.size(); ++i) {
    const auto from_point = from_view.point(from_rays[i]), to_point = to_view.point(to_rays[i]);
    if (!from_point || !to_point) continue;
    from.push_back(opencv_point(*from_point));
    to.push_back(opencv_point(*to_point));
  }
  if (from.size() < kMinCommon) return {};
  const double of_first = inlier_threshold(a.lens, options),
               of_second = inlier_threshold(b.lens, options);
  const double noise = std::sqrt((of_first * of_first + of_second * of_second) / 2);
  cv::setRNGSeed(1);
  cv::Mat inliers, rotation, translation;
  const cv::Mat unit = cv::Mat::eye(3, 3, CV_64F);
  const cv::Mat essential = cv::findEssentialMat(from, to, unit, cv::RANSAC, kSure, noise, inliers);
  if (essential.rows != 3) return {};
  const int agree = cv::recoverPose(essential, from, to, unit, rotation, translation, inliers);
  if (agree < kMinCommon) return {};
  Pair pair{first, second, pose_from_opencv_matrix(rotation * opencv_from_ours(), translation), 0};
  std::vector<double> angles;
  for (std::size_t i = 0; i < from.size(); ++i) {
    if (inliers.at<unsigned char>(static_cast<int>(i)) == 0) continue;
    const Vector3d ahead = Vector3d(from[i].x, -from[i].y, -1).normalized();
    const Vector3d other =
        (pair.second_pose.world_from_camera_rotation * Vector3d(to[i].x, -to[i].y, -1))
            .normalized();
    angles.push_back(std::atan2(ahead.cross(other).norm(), ahead.dot(other)));
  }

  constexpr double kWideEnough = 0.3;  // radians; a larger angle brings no more accuracy
  pair.score = agree * std::min(median(std::move(angles)), kWideEnough);
  // From the views to the cameras; the first camera is at the origin.
  pair.second_pose.world_from_camera_rotation = from_view.camera_from_view() *
                                                pair.second_pose.world_from_camera_rotation *
                                                to_view.camera_from_view().transpose();
  pair.second_pose.position = from_view.camera_from_view() * pair.second_pose.position;
  return pair;
}

void throw_if_stopped(const InitialPosesOptions& options) {
  if (options.stop.stop_requested()) {
    throw Error::failed("the calibration was stopped", "", "Start it again");
  }
}

Pair best_pair(const std::vector<CameraObservations>& observations,
               const InitialPosesOptions& options) {
  // Pairs of the camera with the most observations and every other.
  const auto most = std::ranges::max_element(
      observations, {}, [](const CameraObservations& camera) { return camera.rays.size(); });
  const int first = static_cast<int>(most - observations.begin());
  Pair best;
  for (int second = 0; second < static_cast<int>(observations.size()); ++second) {
    if (second == first) continue;
    throw_if_stopped(options);
    const Pair pair = score_pair(observations, first, second, options);
    if (pair.score > best.score) best = pair;
  }
  return best;
}

/// A camera registered by known points.
struct Registration {
  rig::Pose pose;
  double focal_ratio = 1;  // relative to the initial focal length
  std::size_t agree = 0;   // inliers
  std::size_t used = 0;    // points that were tried
};

/// Known points of the world and the observations of a camera.
struct KnownPoints {
  std::vector<Vector3d> points, rays;
  std::vector<Eigen::Vector2d> pixels;
};

/// Returns the lens with a focal length `factor` times as long.
rig::CameraModel zoomed(const rig::CameraModel& lens, double factor) {
  schemas::CameraGeometry geometry{"", lens.width(), lens.height(), lens.intrinsics(), {}, {}, {}};
  geometry.intrinsics.fx *= factor;
  geometry.intrinsics.fy *= factor;
  return rig::CameraModel(geometry);
}

/// Registers a camera whose focal length is `factor` times that of `lens`: the ideal image points
/// of a pinhole are rescaled, the rays of a fisheye computed again.
Registration register_with_focal_ratio(const rig::CameraModel& lens, const KnownPoints& known,
                                       double noise, double factor) {
  std::vector<Vector3d> rays = known.rays, places = known.points;
  const bool is_fisheye = lens.fisheye() != nullptr;
  if (is_fisheye && factor != 1) {
    rays.clear();
    places.clear();
    const rig::CameraModel other = zoomed(lens, factor);
    for (std::size_t i = 0; i < known.pixels.size(); ++i) {
      const auto ray = other.unproject(known.pixels[i]);
      if (!ray) continue;
      rays.push_back(*ray);
      places.push_back(known.points[i]);
    }
  }
  const RayView view(lens, rays);
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> scaled;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const auto place = view.point(rays[i]);
    if (!place) continue;
    points.emplace_back(places[i].x(), places[i].y(), places[i].z());
    scaled.push_back(opencv_point(*place));
    if (!is_fisheye) scaled.back() *= 1 / factor;
  }
  if (points.size() < kMinKnown) return {};
  cv::setRNGSeed(1);
  const cv::Mat unit = cv::Mat::eye(3, 3, CV_64F);
  cv::Mat turn, translation;
  std::vector<int> inliers;
  constexpr int kTries = 1000;
  try {
    if (!cv::solvePnPRansac(points, scaled, unit, {}, turn, translation, false, kTries,
                            static_cast<float>(noise / factor), kSure, inliers,
                            cv::SOLVEPNP_SQPNP)) {
      return {{}, 1, 0, points.size()};
    }
  } catch (const cv::Exception&) {  // points that almost coincide
    return {{}, 1, 0, points.size()};
  }
  rig::Pose pose = pose_from_opencv(turn, translation);
  pose.world_from_camera_rotation =
      pose.world_from_camera_rotation * view.camera_from_view().transpose();
  return {pose, factor, inliers.size(), points.size()};
}

/// Returns a camera's pose from the known points; none with too few inliers.
std::optional<Registration> register_camera(const ArrayModel& model,
                                            const CameraObservations& observed,
                                            const InitialPosesOptions& options) {
  KnownPoints known;
  for (const auto& [point, ray] : observed.rays) {
    const auto& found = model.points[point];
    if (!found) continue;
    known.points.push_back(*found);
    known.rays.push_back(ray);
    known.pixels.push_back(observed.pixels.at(point));
  }
  if (known.points.size() < kMinKnown) return std::nullopt;
  const double noise = inlier_threshold(observed.lens, options);
  Registration best = register_with_focal_ratio(observed.lens, known, noise, 1);
  const std::size_t most = best.used * 4 / 5;
  for (const double factor : {0.8, 1.25, 0.64, 1.56, 0.5, 2.0}) {
    if (!options.estimates_focal_lengths || best.agree >= most) break;
    const Registration other = register_with_focal_ratio(observed.lens, known, noise, factor);
    if (other.agree > best.agree) best = other;
  }
  if (best.agree < std::max<std::size_t>(kMinKnown, best.used / 3)) return std::nullopt;
  return best;
}

void refine(ArrayModel& model, const InitialPosesOptions& options) {
  BundleAdjustmentOptions bundle;
  bundle.max_iterations = 30;
  bundle.loss_scale_px = options.max_error_px / 4;
  bundle.fixed_cameras = options.fixed_cameras;
  bundle.stop = options.stop;
  run_bundle_adjustment(model, bundle);
  classify_outliers(model, options.max_error_px);
  triangulate_points(model, options.max_error_px);
}

}  // namespace

bool InitialPosesOptions::is_valid(std::string* reason) const {
  return is_within("reprojection error (pixels)", max_error_px, 1e-6, 1e6, reason);
}

bool estimate_initial_poses(ArrayModel& model, const InitialPosesOptions& options) {
  require_valid(options, "initial poses");
  const Pair pair = best_pair(observations_by_camera(model), options);
  if (pair.first < 0) return false;
  model.cameras[pair.first].pose = rig::Pose{};
  model.cameras[pair.second].pose = pair.second_pose;
  triangulate_points(model, options.max_error_px);
  refine(model, options);
  register_cameras(model, options);
  return true;
}

void register_cameras(ArrayModel& model, const InitialPosesOptions& options) {
  require_valid(options, "initial poses");
  const std::vector<CameraObservations> observations = observations_by_camera(model);
  const auto known_of = [&](const CameraObservations& observed) {
    return std::ranges::count_if(
        observed.rays, [&](const auto& seen) { return model.points[seen.first].has_value(); });
  };
  auto placed_cameras = static_cast<std::size_t>(std::ranges::count_if(
      model.cameras, [](const ArrayModel::Camera& camera) { return camera.pose.has_value(); }));
  std::size_t refined_at = placed_cameras;
  while (placed_cameras < model.cameras.size()) {
    // Cameras with the most known points come first; some succeed only later.
    std::vector<std::pair<std::ptrdiff_t, std::size_t>> next;
    for (std::size_t i = 0; i < model.cameras.size(); ++i) {
      if (!model.cameras[i].pose) next.emplace_back(known_of(observations[i]), i);
    }
    std::ranges::sort(next, std::greater<>());
    bool found = false;
    for (const auto& [known, camera] : next) {
      if (known < kMinKnown) break;
      throw_if_stopped(options);
      const auto placement = register_camera(model, observations[camera], options);
      if (!placement) continue;
      model.cameras[camera].pose = placement->pose;
      model.cameras[camera].intrinsics.fx *= placement->focal_ratio;
      model.cameras[camera].intrinsics.fy *= placement->focal_ratio;
      ++placed_cameras;
      found = true;
      break;
    }
    if (!found) break;
    triangulate_points(model, options.max_error_px);
    if (placed_cameras >= refined_at + std::max<std::size_t>(1, refined_at / 2)) {
      refine(model, options);
      refined_at = placed_cameras;
    }
  }
  refine(model, options);
}

}  // namespace raystage::calibrate
