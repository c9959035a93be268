// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "calibrate/geometry/detections.h"
#include "calibrate/geometry/lens_start.h"
#include "rig/camera_model.h"
#include "rig/pose.h"
#include "schemas/geometry.h"

namespace raystage::calibrate {

/// The camera models of an array, by camera. Copies are cheap.
class CameraModels {
 public:
  CameraModels() = default;
  explicit CameraModels(std::vector<rig::CameraModel> models)
      : models_(std::make_shared<const std::vector<rig::CameraModel>>(std::move(models))) {}
  std::size_t size() const { return models_ ? models_->size() : 0; }
  const rig::CameraModel& operator[](std::size_t camera) const { return (*models_)[camera]; }

 private:
  std::shared_ptr<const std::vector<rig::CameraModel>> models_;
};

/// Remembers camera models between calls of camera_models(): each takes 24 us, because the end of
/// its distortion is searched. Thread-safe.
class CameraModelMemo {
 public:
  CameraModelMemo() = default;
  CameraModelMemo(const CameraModelMemo& other) : models_(other.get()) {}
  CameraModelMemo& operator=(const CameraModelMemo& other) {
    if (this != &other) set(other.get());
    return *this;
  }
  ~CameraModelMemo() = default;
  CameraModels get() const {
    const std::scoped_lock lock(mutex_);
    return models_;
  }
  void set(CameraModels models) const {
    const std::scoped_lock lock(mutex_);
    models_ = std::move(models);
  }

 private:
  mutable std::mutex mutex_;
  mutable CameraModels models_;
};

/// State of a calibration: cameras, points and observations. The origin, rotation and scale of the
/// world are arbitrary until it is aligned (see world_frame.h).
struct ArrayModel {
  struct Camera {
    std::string id;
    int width = 0, height = 0;  ///< pixels
    schemas::Intrinsics intrinsics;
    std::optional<rig::Pose> pose;  ///< none: not determined
  };
  /// A detection that may be an outlier.
  struct Observation {
    int camera = 0, point = 0;  ///< indices into `cameras` and `points`
    Eigen::Vector2d pixel;
    bool is_outlier = false;
  };
  /// A rigid body that carries points: a board at one instant.
  struct RigidBody {
    std::optional<rig::Pose> pose;  ///< world from body; none: not determined
    std::vector<int> points = {};   ///< indices into `points`
    /// position of each point in the body, metres
    std::vector<Eigen::Vector3d> points_in_body = {};
  };
  std::vector<Camera> cameras;
  /// empty: independent points; otherwise each point belongs to one body
  std::vector<RigidBody> bodies;
  std::vector<std::optional<Eigen::Vector3d>> points;  ///< world; none: not determined
  std::vector<int> point_ids;                          ///< their numbers in the detections
  std::vector<Observation> observations;               ///< by point, then by camera
  CameraModelMemo known_camera_models = {};            ///< use camera_models()

  /// Returns whether an observation is used: its camera and point are determined and it is an
  /// inlier.
  bool counts(const Observation& observation) const {
    return !observation.is_outlier && cameras[observation.camera].pose && points[observation.point];
  }
};

/// Computes the points of all bodies from their poses; points of bodies without a pose become
/// undetermined.
void update_body_points(ArrayModel& model);

/// Returns a model without poses and points. Every camera has the initial_lens() of this horizontal
/// field of view, radians. `lens_models`: by camera; empty: pinholes.
ArrayModel make_initial_model(const Detections& detections, double horizontal_fov,
                              std::span<const LensModel> lens_models = {});

/// Returns the model of each camera. Only those whose lens has changed since the last call are made
/// anew. Throws Error (bad input) if CameraModel rejects a lens.
CameraModels camera_models(const ArrayModel& model);

/// Returns the observed minus the projected position of the point, pixels. Returns none if the
/// point is behind the camera, beyond the end of its lens model, or not determined. `lenses`: of
/// camera_models().
std::optional<Eigen::Vector2d> reprojection_residual(const ArrayModel& model,
                                                     const CameraModels& lenses,
                                                     const ArrayModel::Observation& observation);

/// Returns the RMS length of the residuals that are used, pixels; NaN if there are none.
double rms_reprojection_error(const ArrayModel& model);
/// Returns the lengths of the residuals that are used, pixels.
std::vector<double> reprojection_errors(const ArrayModel& model);

}  // namespace raystage::calibrate
