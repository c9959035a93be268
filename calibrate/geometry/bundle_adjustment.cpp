// SPDX-License-Identifier: Apache-2.0
// Bundle adjustment (thesis 4.3: one large least squares over all poses, intrinsics and points)
// with Ceres. Levenberg-Marquardt, dense Schur complement with points or boards eliminated,
// Cauchy's loss. Residuals are reprojection errors in pixels plus weak priors on the lenses. Poses,
// lenses and points of the model are updated in place. Cost per iteration: observations plus
// cameras cubed.
#include "calibrate/geometry/bundle_adjustment.h"

#include <ceres/autodiff_cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/ordered_groups.h>
#include <ceres/problem.h>
#include <ceres/product_manifold.h>
#include <ceres/solver.h>
#include <glog/logging.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <memory>
#include <optional>

#include "base/error.h"
#include "base/options.h"
#include "calibrate/geometry/ceres_options.h"
#include "calibrate/geometry/lens_projection.h"

namespace raystage::calibrate {
namespace {

struct Reprojection {
  Eigen::Vector2d pixel;
  const rig::RadialProjection* fisheye;  // null: a pinhole
  bool square_pixels;

  template <class T>
  bool operator()(const T* rotation, const T* centre, const T* lens, const T* point,
                  T* residual) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Eigen::Quaternion<T>> camera_from_world(rotation);
    const Vector from_centre = Eigen::Map<const Vector>(point) - Eigen::Map<const Vector>(centre);
    const Vector in_camera = camera_from_world * from_centre;
    if (!has_projection<T>(in_camera, fisheye)) return false;  // the step is rejected
    const Eigen::Matrix<T, 2, 1> seen =
        project_to_pixel<T>(in_camera, lens, fisheye, square_pixels);
    residual[0] = seen.x() - pixel.x();
    residual[1] = seen.y() - pixel.y();
    return true;
  }
};

/// Reprojection error of a point that moves with a body.
struct BodyReprojection {
  Reprojection of_point;
  Eigen::Vector3d points_in_body;

  template <class T>
  bool operator()(const T* rotation, const T* centre, const T* lens, const T* body,
                  T* residual) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Eigen::Quaternion<T>> body_from_world(body);
    const Vector point =
        body_from_world.conjugate() * points_in_body.cast<T>() + Eigen::Map<const Vector>(body + 4);
    return of_point(rotation, centre, lens, point.data(), residual);
  }
};

/// Weak prior on an ordinary lens, for parameters that the observations leave open.
struct OrdinaryLens {
  const LensParameterization* parameterization;
  Eigen::Vector2d middle;
  double width;

  template <class T>
  bool operator()(const T* lens, T* residual) const {
    constexpr double kMiddle = 0.1;  // of the width
    residual[0] = (lens[2] - middle.x()) / (kMiddle * width);
    residual[1] = (lens[3] - middle.y()) / (kMiddle * width);
    for (std::size_t i = 4; i < kLensParameterCount; ++i) {
      residual[i - 2] = lens[i] / parameterization->parameters()[i].ordinary_deviation;
    }
    return true;
  }
};

/// Shared lens prior: lenses of one model differ little except for their principal points.
struct OneKind {
  const LensParameterization* parameterization;
  double focal_length, noise_px;

  template <class T>
  bool operator()(const T* lens, const T* kind, T* residual) const {
    for (std::size_t i = 0; i < kLensParameterCount; ++i) {
      const double in_type = parameterization->parameters()[i].deviation_in_type;
      const double deviation = in_type * (i < 2 ? focal_length : 1);
      residual[i] = in_type == 0 ? T(0) : noise_px * (lens[i] - kind[i]) / deviation;
    }
    return true;
  }
};

/// The model as parameter blocks of Ceres.
struct Values {
  std::vector<Eigen::Quaterniond> rotations;  // camera_from_world
  std::vector<Eigen::Vector3d> centres, points;
  /// For each body the quaternion of body_from_world (x, y, z, w) and its position: one block, so
  /// that bodies can be eliminated like points.
  std::vector<std::array<double, 7>> bodies;
  std::vector<LensParameters> lenses;  // shared, or one per camera

  Values(const ArrayModel& model, bool shared_lens) {
    for (const ArrayModel::Camera& camera : model.cameras) {
      const rig::Pose pose = camera.pose.value_or(rig::Pose{});
      rotations.emplace_back(pose.world_from_camera_rotation.transpose());
      centres.push_back(pose.position);
      if (lenses.empty() || !shared_lens) lenses.push_back(lens_parameters(camera.intrinsics));
    }
    for (const auto& point : model.points)
      points.push_back(point.value_or(Eigen::Vector3d::Zero()));
    for (const ArrayModel::RigidBody& body : model.bodies) {
      const rig::Pose pose = body.pose.value_or(rig::Pose{});
      const Eigen::Quaterniond turn(pose.world_from_camera_rotation.transpose());
      const Eigen::Vector3d& at = pose.position;
      bodies.push_back({turn.x(), turn.y(), turn.z(), turn.w(), at.x(), at.y(), at.z()});
    }
  }
  LensParameters& lens(std::size_t camera) { return lenses[lenses.size() == 1 ? 0 : camera]; }

  void store(ArrayModel& model, bool square_pixels) {
    for (std::size_t i = 0; i < model.cameras.size(); ++i) {
      ArrayModel::Camera& camera = model.cameras[i];
      LensParameters& values = lens(i);
      if (square_pixels) values[1] = values[0];
      camera.intrinsics = lens_with_parameters(values, camera.intrinsics);
      if (!camera.pose) continue;
      camera.pose = rig::Pose{rotations[i].normalized().toRotationMatrix().transpose(), centres[i]};
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (model.points[i]) model.points[i] = points[i];
    }
    for (std::size_t i = 0; i < model.bodies.size(); ++i) {
      if (!model.bodies[i].pose) continue;
      const Eigen::Quaterniond turn(bodies[i].data());
      model.bodies[i].pose = rig::Pose{turn.normalized().toRotationMatrix().transpose(),
                                       {bodies[i][4], bodies[i][5], bodies[i][6]}};
    }
    update_body_points(model);
  }
};

/// Fixes the gauge: translation, rotation and scale of the world. Unless cameras are held, the
/// first camera is; unless two are, also the largest coordinate difference of the camera farthest
/// from it.
struct Gauge {
  std::size_t first = 0, other = 0;
  int axis = 0;
  bool holds_scale = true;
};

std::optional<Gauge> gauge_of(const ArrayModel& model, const std::vector<bool>& held) {
  std::vector<std::size_t> in_use;
  std::vector<bool> is_seen_by(model.cameras.size(), false);
  for (const ArrayModel::Observation& observation : model.observations) {
    if (model.counts(observation)) is_seen_by[observation.camera] = true;
  }
  for (std::size_t i = 0; i < is_seen_by.size(); ++i) {
    if (is_seen_by[i]) in_use.push_back(i);
  }
  if (in_use.empty()) return std::nullopt;
  const auto is_held = [&](std::size_t i) { return i < held.size() && held[i]; };
  const auto first = std::ranges::find_if(in_use, is_held);
  Gauge gauge;
  gauge.first = first == in_use.end() ? in_use.front() : *first;
  gauge.other = gauge.first;
  gauge.holds_scale = std::ranges::count_if(in_use, is_held) < 2;
  double farthest = 0;
  for (const std::size_t i : in_use) {
    const Eigen::Vector3d way =
        model.cameras[i].pose->position - model.cameras[gauge.first].pose->position;
    if (way.norm() <= farthest) continue;
    farthest = way.norm();
    gauge.other = i;
    way.cwiseAbs().maxCoeff(&gauge.axis);
  }
  return gauge;
}

void drop_what_is_unseen(ArrayModel& model) {
  const bool has_fisheyes = std::ranges::any_of(model.cameras, [](const auto& camera) {
    return fisheye_projection(camera.intrinsics) != nullptr;
  });
  const CameraModels lenses = has_fisheyes ? camera_models(model) : CameraModels{};
  for (ArrayModel::Observation& observation : model.observations) {
    if (!model.counts(observation)) continue;
    const rig::Pose& pose = *model.cameras[observation.camera].pose;
    const Eigen::Vector3d in_camera = pose.camera_from_world(*model.points[observation.point]);
    const bool is_fisheye = has_fisheyes && lenses[observation.camera].fisheye() != nullptr;
    observation.is_outlier =
        is_fisheye ? !lenses[observation.camera].project(in_camera) : !(in_camera.z() < 0);
  }
}

/// For each point its body and the position on it. Empty for independent points.
struct PlaceInBody {
  std::size_t body = 0;
  Eigen::Vector3d points_in_body = Eigen::Vector3d::Zero();
};

std::vector<PlaceInBody> places_in_bodies(const ArrayModel& model) {
  std::vector<PlaceInBody> places(model.bodies.empty() ? 0 : model.points.size());
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    const ArrayModel::RigidBody& body = model.bodies[b];
    for (std::size_t i = 0; i < body.points.size(); ++i) {
      places[body.points[i]] = {b, body.points_in_body[i]};
    }
  }
  return places;
}

/// Disables the log of Ceres, which lists rejected trial steps. The report contains the results.
void keep_ceres_quiet() { FLAGS_minloglevel = google::FATAL; }

}  // namespace

bool shares_one_lens(const ArrayModel& model, const BundleAdjustmentOptions& options) {
  return options.shared_lens &&
         std::ranges::all_of(model.cameras, [&](const ArrayModel::Camera& camera) {
           return camera.intrinsics.projection == model.cameras.front().intrinsics.projection;
         });
}

bool BundleAdjustmentOptions::is_valid(std::string* reason) const {
  return is_within("noise of the lens prior (pixels)", lens_prior_noise_px, 0, 1e6, reason) &&
         is_within("loss scale (pixels)", loss_scale_px, 0, 1e6, reason) &&
         is_within("iterations", max_iterations, 1, 1e6, reason);
}

BundleAdjustmentReport run_bundle_adjustment(ArrayModel& model,
                                             const BundleAdjustmentOptions& settings) {
  require_valid(settings, "bundle adjustment");
  keep_ceres_quiet();
  drop_what_is_unseen(model);
  // Held lenses keep their individual values.
  Values values(model, shares_one_lens(model, settings) && settings.lens != LensRefinement::kNone);
  const bool square_pixels =
      settings.lens != LensRefinement::kNone && settings.lens != LensRefinement::kFullModel;
  ceres::Problem::Options ownership;
  ownership.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::EigenQuaternionManifold turns;
  ceres::ProductManifold<ceres::EigenQuaternionManifold, ceres::EuclideanManifold<3>> body_moves;
  std::map<schemas::Projection, std::unique_ptr<ceres::SubsetManifold>> some_of_lens;
  for (const ArrayModel::Camera& camera : model.cameras) {
    const schemas::Projection projection = camera.intrinsics.projection;
    const std::vector<int> held = fixed_lens_parameters(settings.lens, projection);
    if (held.empty() || settings.lens == LensRefinement::kNone) continue;
    some_of_lens[projection] = std::make_unique<ceres::SubsetManifold>(kLensParameterCount, held);
  }
  ceres::CauchyLoss cauchy(settings.loss_scale_px > 0 ? settings.loss_scale_px : 1);
  ceres::LossFunction* loss = settings.loss_scale_px > 0 ? &cauchy : nullptr;
  ceres::Problem problem(ownership);
  const auto hold_some_of_lens = [&](double* lens, std::size_t camera) {
    const auto some = some_of_lens.find(model.cameras[camera].intrinsics.projection);
    if (some != some_of_lens.end()) problem.SetManifold(lens, some->second.get());
  };
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  BundleAdjustmentReport report;
  const bool has_bodies = !model.bodies.empty();
  const auto place_in_body = places_in_bodies(model);
  for (const ArrayModel::Observation& observation : model.observations) {
    if (!model.counts(observation)) continue;
    const auto camera = static_cast<std::size_t>(observation.camera);
    double* rotation = values.rotations[camera].coeffs().data();
    double* centre = values.centres[camera].data();
    double* lens = values.lens(camera).data();
    Reprojection reprojection{observation.pixel,
                              fisheye_projection(model.cameras[camera].intrinsics), square_pixels};
    if (has_bodies) {
      const auto& [body, points_in_body] = place_in_body[observation.point];
      double* body_pose = values.bodies[body].data();
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<BodyReprojection, 2, 4, 3, kLensParameterCount, 7>(
              new BodyReprojection{reprojection, points_in_body}),
          loss, rotation, centre, lens, body_pose);
      problem.SetManifold(body_pose, &body_moves);
      ordering->AddElementToGroup(body_pose, 0);
    } else {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Reprojection, 2, 4, 3, kLensParameterCount, 3>(
              new Reprojection(reprojection)),
          loss, rotation, centre, lens, values.points[observation.point].data());
      ordering->AddElementToGroup(values.points[observation.point].data(), 0);
    }
    for (double* block : {rotation, centre, lens}) ordering->AddElementToGroup(block, 1);
    problem.SetManifold(rotation, &turns);
    if (camera < settings.fixed_cameras.size() && settings.fixed_cameras[camera]) {
      problem.SetParameterBlockConstant(rotation);
      problem.SetParameterBlockConstant(centre);
    }
    if (settings.lens == LensRefinement::kNone) {
      problem.SetParameterBlockConstant(lens);
    } else {
      hold_some_of_lens(lens, camera);
    }
    ++report.observations;
  }
  const std::optional<Gauge> gauge = gauge_of(model, settings.fixed_cameras);
  if (report.observations == 0 || !gauge) return report;
  ceres::SubsetManifold all_but_one(3, {gauge->axis});
  problem.SetParameterBlockConstant(values.rotations[gauge->first].coeffs().data());
  problem.SetParameterBlockConstant(values.centres[gauge->first].data());
  if (!has_bodies && gauge->holds_scale && gauge->other != gauge->first) {
    problem.SetManifold(values.centres[gauge->other].data(), &all_but_one);
  }
  if (settings.lens >= LensRefinement::kPinhole) {
    for (std::size_t i = 0; i < model.cameras.size(); ++i) {
      double* lens = values.lens(i).data();
      if (!problem.HasParameterBlock(lens)) continue;
      const ArrayModel::Camera& camera = model.cameras[i];
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<OrdinaryLens, 7, kLensParameterCount>(
              new OrdinaryLens{&lens_parameterization(camera.intrinsics.projection),
                               {camera.width / 2.0, camera.height / 2.0},
                               static_cast<double>(camera.width)}),
          nullptr, lens);
      if (values.lenses.size() == 1) break;
    }
  }
  LensParameters kind = values.lenses.front();  // initial values
  const bool is_one_kind = settings.lens_prior_noise_px > 0 && !settings.shared_lens;
  for (std::size_t i = 0; is_one_kind && i < model.cameras.size(); ++i) {
    double* lens = values.lens(i).data();
    if (settings.lens == LensRefinement::kNone || !problem.HasParameterBlock(lens)) continue;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<OneKind, kLensParameterCount, kLensParameterCount,
                                        kLensParameterCount>(
            new OneKind{&lens_parameterization(model.cameras[i].intrinsics.projection), kind[0],
                        settings.lens_prior_noise_px}),
        nullptr, lens, kind.data());
    ordering->AddElementToGroup(kind.data(), 1);
    hold_some_of_lens(kind.data(), i);
  }
  // Trials run in parallel instead (solve.cpp).
  ceres::Solver::Options options =
      ceres_options(ceres::DENSE_SCHUR, settings.max_iterations, 1e-10);
  options.linear_solver_ordering = ordering;
  CeresStopCallback stops(settings.stop);
  options.callbacks.push_back(&stops);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (settings.stop.stop_requested()) {
    throw Error::failed("the calibration was stopped", "", "Start it again");
  }
  if (summary.IsSolutionUsable()) {
    values.store(model, square_pixels);
    report.status = RunStatus::kFinished;
  }
  report.rms_px = rms_reprojection_error(model);
  return report;
}

int classify_outliers(ArrayModel& model, double max_error_px) {
  const CameraModels lenses = camera_models(model);
  int changed = 0;
  std::vector<int> seen_by(model.points.size(), 0);
  for (ArrayModel::Observation& observation : model.observations) {
    const auto residual = reprojection_residual(model, lenses, observation);
    const bool is_found = model.cameras[observation.camera].pose && model.points[observation.point];
    if (!is_found) continue;
    const bool is_outlier = !residual || !(residual->norm() <= max_error_px);
    changed += is_outlier != observation.is_outlier ? 1 : 0;
    observation.is_outlier = is_outlier;
    if (!is_outlier) ++seen_by[observation.point];
  }
  for (std::size_t i = 0; i < seen_by.size() && model.bodies.empty(); ++i) {
    if (seen_by[i] < 2) model.points[i].reset();
  }
  return changed;
}

}  // namespace raystage::calibrate
