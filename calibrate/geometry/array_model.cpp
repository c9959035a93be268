// SPDX-License-Identifier: Apache-2.0
// Makes the initial cameras of a calibration from a field of view, places the points of
// rigid bodies, and computes reprojection residuals in pixels. Residuals cost one projection per
// observation.
#include "calibrate/geometry/array_model.h"

#include <cmath>
#include <limits>
#include <map>

namespace raystage::calibrate {

ArrayModel make_initial_model(const Detections& detections, double horizontal_fov,
                              std::span<const LensModel> lens_models) {
  ArrayModel model;
  for (std::size_t c = 0; c < detections.cameras.size(); ++c) {
    const auto& camera = detections.cameras[c];
    const LensModel lens = lens_models.empty() ? LensModel{} : lens_models[c];
    model.cameras.push_back({camera.id, camera.width, camera.height,
                             initial_lens(lens, camera.width, camera.height, horizontal_fov),
                             std::nullopt});
  }
  std::map<int, int> point_of_frame;
  for (const Detections::Detection& d : detections.detections) {
    const auto [place, is_new] =
        point_of_frame.emplace(d.point, static_cast<int>(model.points.size()));
    if (is_new) {
      model.points.emplace_back();
      model.point_ids.push_back(d.point);
    }
    model.observations.push_back({d.camera, place->second, d.pixel});
  }
  return model;
}

void update_body_points(ArrayModel& model) {
  for (const ArrayModel::RigidBody& body : model.bodies) {
    for (std::size_t i = 0; i < body.points.size(); ++i) {
      auto& point = model.points[body.points[i]];
      point.reset();
      if (body.pose) point = body.pose->world_from_camera(body.points_in_body[i]);
    }
  }
}

CameraModels camera_models(const ArrayModel& model) {
  const CameraModels known = model.known_camera_models.get();
  const auto is_known = [&](std::size_t c) {
    const ArrayModel::Camera& camera = model.cameras[c];
    return c < known.size() && known[c].width() == camera.width &&
           known[c].height() == camera.height && known[c].intrinsics() == camera.intrinsics;
  };
  std::vector<rig::CameraModel> models;
  bool all_known = known.size() == model.cameras.size();
  for (std::size_t c = 0; c < model.cameras.size(); ++c) {
    const ArrayModel::Camera& camera = model.cameras[c];
    if (is_known(c)) {
      models.push_back(known[c]);
      continue;
    }
    all_known = false;
    models.emplace_back(schemas::CameraGeometry{
        camera.id, camera.width, camera.height, camera.intrinsics, {}, {}, {}});
  }
  if (all_known) return known;
  CameraModels made(std::move(models));
  model.known_camera_models.set(made);
  return made;
}

std::optional<Eigen::Vector2d> reprojection_residual(const ArrayModel& model,
                                                     const CameraModels& lenses,
                                                     const ArrayModel::Observation& observation) {
  const auto& pose = model.cameras[observation.camera].pose;
  const auto& point = model.points[observation.point];
  if (!pose || !point) return std::nullopt;
  const auto seen = lenses[observation.camera].project(pose->camera_from_world(*point));
  if (!seen) return std::nullopt;
  return observation.pixel - *seen;
}

std::vector<double> reprojection_errors(const ArrayModel& model) {
  const CameraModels lenses = camera_models(model);
  std::vector<double> errors;
  for (const ArrayModel::Observation& observation : model.observations) {
    if (!model.counts(observation)) continue;
    const auto residual = reprojection_residual(model, lenses, observation);
    if (residual) errors.push_back(residual->norm());
  }
  return errors;
}

double rms_reprojection_error(const ArrayModel& model) {
  const std::vector<double> errors = reprojection_errors(model);
  if (errors.empty()) return std::numeric_limits<double>::quiet_NaN();
  double sum = 0;
  for (const double error : errors) sum += error * error;
  return std::sqrt(sum / static_cast<double>(errors.size()));
}

}  // namespace raystage::calibrate
