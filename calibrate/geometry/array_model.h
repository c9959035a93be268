// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "calibrate/geometry/detections.h"
#include "rig/camera_model.h"
#include "rig/pose.h"
#include "schemas/geometry.h"

namespace raystage {

/// What calibration knows of an array and of what it saw, while it finds out. The world's place,
/// direction and scale are arbitrary until aligned (see alignment.h).
struct ArrayModel {
  struct Camera {
    std::string id;
    int width = 0, height = 0;  ///< pixels
    Intrinsics intrinsics;
    std::optional<Pose> pose;  ///< none: not found
  };
  /// A detection, and whether it counts.
  struct Observation {
    int camera = 0, point = 0;  ///< indices into `cameras` and `points`
    Eigen::Vector2d pixel;
    bool is_outlier = false;
  };
  /// Something rigid that points are part of: a board at one instant.
  struct RigidBody {
    std::optional<Pose> pose;                          ///< world from body; none: not found
    std::vector<int> points = {};                      ///< indices into `points`
    std::vector<Eigen::Vector3d> points_in_body = {};  ///< where on it each of them is, metres
  };
  std::vector<Camera> cameras;
  std::vector<RigidBody> bodies;  ///< empty: points are on their own; else each is of one of them
  std::vector<std::optional<Eigen::Vector3d>> points;  ///< world; none: not found
  std::vector<int> point_ids;                          ///< as the detections call them
  std::vector<Observation> observations;               ///< by point, then by camera

  /// Whether an observation counts: of a camera and a point that are found, and no outlier.
  bool counts(const Observation& observation) const {
    return !observation.is_outlier && cameras[static_cast<std::size_t>(observation.camera)].pose &&
           points[static_cast<std::size_t>(observation.point)];
  }
};

/// Puts the points of bodies that are found where these are, and takes away those of others.
void update_body_points(ArrayModel& model);

/// Nothing found yet; every camera with a lens of this horizontal field of view (radians), the
/// principal point in the middle, no distortion.
ArrayModel make_initial_model(const Detections& detections, double horizontal_fov);

/// Of each camera. Throws Error (bad input) where a lens is none that CameraModel takes.
std::vector<CameraModel> make_camera_models(const ArrayModel& model);

/// Pixels from where the camera would see the point to where it did; none where it cannot see it
/// (behind it, or beyond the end of its lens model), or one of them is not found. `lenses`: the
/// model's.
std::optional<Eigen::Vector2d> reprojection_residual(const ArrayModel& model,
                                                     const std::vector<CameraModel>& lenses,
                                                     const ArrayModel::Observation& observation);

/// Root mean square of the lengths of the residuals that count, pixels; NaN where none does.
double rms_reprojection_error(const ArrayModel& model);
/// The lengths of the residuals that count, pixels.
std::vector<double> reprojection_errors(const ArrayModel& model);

}  // namespace raystage
