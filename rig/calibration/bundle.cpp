// SPDX-License-Identifier: Apache-2.0
#include "rig/calibration/bundle.h"

#include <ceres/autodiff_cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/ordered_groups.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

namespace raystage {
namespace {

/// fx, fy, cx, cy, k1, k2, p1, p2, k3.
using LensValues = std::array<double, 9>;

LensValues values_of(const Intrinsics& k) {
  const Distortion& d = k.distortion;
  return {k.fx, k.fy, k.cx, k.cy, d.k1, d.k2, d.p1, d.p2, d.k3};
}

Intrinsics lens_of(const LensValues& v) {
  return {v[0], v[1], v[2], v[3], {v[4], v[5], v[6], v[7], v[8]}};
}

/// CameraModel's projection, for numbers with derivatives.
struct Reprojection {
  Eigen::Vector2d pixel;
  bool one_focal_length;

  template <class T>
  bool operator()(const T* rotation, const T* centre, const T* lens, const T* point,
                  T* residual) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Eigen::Quaternion<T>> camera_from_world(rotation);
    const Vector from_centre = Eigen::Map<const Vector>(point) - Eigen::Map<const Vector>(centre);
    const Vector in_camera = camera_from_world * from_centre;
    if (!(in_camera.z() < T(0))) return false;  // behind: this step leads nowhere
    const T x = in_camera.x() / -in_camera.z(), y = in_camera.y() / in_camera.z();
    const T s = x * x + y * y;
    const T factor = T(1) + s * (lens[4] + s * (lens[5] + s * lens[8]));
    const T &p1 = lens[6], &p2 = lens[7];
    const T u = x * factor + T(2) * p1 * x * y + p2 * (s + T(2) * x * x);
    const T v = y * factor + p1 * (s + T(2) * y * y) + T(2) * p2 * x * y;
    residual[0] = lens[0] * u + lens[2] - pixel.x();
    residual[1] = lens[one_focal_length ? 0 : 1] * v + lens[3] - pixel.y();
    return true;
  }
};

/// Which of LensValues a solve must not touch.
std::vector<int> held_values(LensFreedom freedom) {
  switch (freedom) {
    case LensFreedom::kNone:
      return {0, 1, 2, 3, 4, 5, 6, 7, 8};
    case LensFreedom::kFocalLength:
      return {1, 2, 3, 4, 5, 6, 7, 8};
    case LensFreedom::kPinhole:
      return {4, 5, 6, 7, 8};
    case LensFreedom::kRadial:
      return {6, 7, 8};
    case LensFreedom::kWholeModel:
      return {};
  }
  return {};
}

/// The model as Ceres moves it.
struct Values {
  std::vector<Eigen::Quaterniond> rotations;  // camera_from_world
  std::vector<Eigen::Vector3d> centres, points;
  std::vector<LensValues> lenses;  // one, or of each camera

  Values(const ArrayModel& model, bool shared_lens) {
    for (const ArrayModel::Camera& camera : model.cameras) {
      const Pose pose = camera.pose.value_or(Pose{});
      rotations.emplace_back(pose.world_from_camera_rotation.transpose());
      centres.push_back(pose.position);
      if (lenses.empty() || !shared_lens) lenses.push_back(values_of(camera.intrinsics));
    }
    for (const auto& point : model.points)
      points.push_back(point.value_or(Eigen::Vector3d::Zero()));
  }
  LensValues& lens(std::size_t camera) { return lenses[lenses.size() == 1 ? 0 : camera]; }

  void store(ArrayModel& model, bool one_focal_length) {
    for (std::size_t i = 0; i < model.cameras.size(); ++i) {
      ArrayModel::Camera& camera = model.cameras[i];
      LensValues& values = lens(i);
      if (one_focal_length) values[1] = values[0];
      camera.intrinsics = lens_of(values);
      if (!camera.pose) continue;
      camera.pose = Pose{rotations[i].normalized().toRotationMatrix().transpose(), centres[i]};
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (model.points[i]) model.points[i] = points[i];
    }
  }
};

/// Place, direction and scale of the world are nobody's to find: the first camera rests, and of the
/// one farthest from it the coordinate in which they differ most.
struct Gauge {
  std::size_t first = 0, other = 0;
  int axis = 0;
};

std::optional<Gauge> gauge_of(const ArrayModel& model) {
  std::vector<std::size_t> in_use(model.cameras.size(), 0);
  for (const ArrayModel::Observation& observation : model.observations) {
    if (model.counts(observation)) ++in_use[static_cast<std::size_t>(observation.camera)];
  }
  const auto first = std::ranges::find_if(in_use, [](std::size_t count) { return count > 0; });
  if (first == in_use.end()) return std::nullopt;
  Gauge gauge{static_cast<std::size_t>(first - in_use.begin()), 0, 0};
  gauge.other = gauge.first;
  double farthest = 0;
  for (std::size_t i = 0; i < in_use.size(); ++i) {
    if (in_use[i] == 0) continue;
    const Eigen::Vector3d way =
        model.cameras[i].pose->position - model.cameras[gauge.first].pose->position;
    if (way.norm() <= farthest) continue;
    farthest = way.norm();
    gauge.other = i;
    way.cwiseAbs().maxCoeff(&gauge.axis);
  }
  return gauge;
}

void drop_what_is_behind(ArrayModel& model) {
  for (ArrayModel::Observation& observation : model.observations) {
    if (!model.counts(observation)) continue;
    const Pose& pose = *model.cameras[static_cast<std::size_t>(observation.camera)].pose;
    const auto& point = *model.points[static_cast<std::size_t>(observation.point)];
    observation.is_outlier = !(pose.camera_from_world(point).z() < 0);
  }
}

}  // namespace

BundleReport adjust(ArrayModel& model, const BundleSettings& settings) {
  drop_what_is_behind(model);
  Values values(model, settings.shared_lens);
  const bool one_focal_length = settings.lens == LensFreedom::kFocalLength;
  ceres::Problem::Options ownership;
  ownership.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::EigenQuaternionManifold turns;
  const std::vector<int> held = held_values(settings.lens);
  std::unique_ptr<ceres::SubsetManifold> some_of_lens;
  if (!held.empty() && settings.lens != LensFreedom::kNone) {
    some_of_lens = std::make_unique<ceres::SubsetManifold>(9, held);
  }
  ceres::CauchyLoss cauchy(settings.loss_px > 0 ? settings.loss_px : 1);
  ceres::LossFunction* loss = settings.loss_px > 0 ? &cauchy : nullptr;
  ceres::Problem problem(ownership);
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  BundleReport report;
  for (const ArrayModel::Observation& observation : model.observations) {
    if (!model.counts(observation)) continue;
    const auto camera = static_cast<std::size_t>(observation.camera);
    const auto point = static_cast<std::size_t>(observation.point);
    double* rotation = values.rotations[camera].coeffs().data();
    double* centre = values.centres[camera].data();
    double* lens = values.lens(camera).data();
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Reprojection, 2, 4, 3, 9, 3>(
                                 new Reprojection{observation.pixel, one_focal_length}),
                             loss, rotation, centre, lens, values.points[point].data());
    problem.SetManifold(rotation, &turns);
    ordering->AddElementToGroup(values.points[point].data(), 0);
    for (double* block : {rotation, centre, lens}) ordering->AddElementToGroup(block, 1);
    if (!settings.moves_cameras) {
      problem.SetParameterBlockConstant(rotation);
      problem.SetParameterBlockConstant(centre);
    }
    if (settings.lens == LensFreedom::kNone) {
      problem.SetParameterBlockConstant(lens);
    } else if (some_of_lens) {
      problem.SetManifold(lens, some_of_lens.get());
    }
    ++report.observations;
  }
  const std::optional<Gauge> gauge = gauge_of(model);
  if (report.observations == 0 || !gauge) return report;
  ceres::SubsetManifold all_but_one(3, {gauge->axis});
  if (settings.moves_cameras) {
    problem.SetParameterBlockConstant(values.rotations[gauge->first].coeffs().data());
    problem.SetParameterBlockConstant(values.centres[gauge->first].data());
    if (gauge->other != gauge->first) {
      problem.SetManifold(values.centres[gauge->other].data(), &all_but_one);
    }
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.linear_solver_ordering = ordering;
  options.max_num_iterations = settings.most_iterations;
  options.num_threads = settings.threads;
  options.function_tolerance = 1e-10;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  report.converged = summary.termination_type == ceres::CONVERGENCE;
  report.iterations = static_cast<int>(summary.iterations.size());
  if (summary.IsSolutionUsable()) values.store(model, one_focal_length);
  report.rms_px = rms_of(model);
  return report;
}

int sort_outliers(ArrayModel& model, double most_px) {
  const std::vector<CameraModel> lenses = lenses_of(model);
  int changed = 0;
  std::vector<int> seen_by(model.points.size(), 0);
  for (ArrayModel::Observation& observation : model.observations) {
    const auto residual = residual_of(model, lenses, observation);
    const bool is_found = model.cameras[static_cast<std::size_t>(observation.camera)].pose &&
                          model.points[static_cast<std::size_t>(observation.point)];
    if (!is_found) continue;
    const bool is_outlier = !residual || !(residual->norm() <= most_px);
    changed += is_outlier != observation.is_outlier ? 1 : 0;
    observation.is_outlier = is_outlier;
    if (!is_outlier) ++seen_by[static_cast<std::size_t>(observation.point)];
  }
  for (std::size_t i = 0; i < seen_by.size(); ++i) {
    if (seen_by[i] < 2) model.points[i].reset();
  }
  return changed;
}

}  // namespace raystage
