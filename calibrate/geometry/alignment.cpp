// SPDX-License-Identifier: Apache-2.0
// Computes the least-squares similarity between two sets of poses after Umeyama (1991), extended by
// the rotations. An SVD decomposes the covariance of the centres plus the weighted products of
// rotations. Cost: linear in the number of poses.
#include "calibrate/geometry/alignment.h"

#include <Eigen/SVD>

namespace raystage::calibrate {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

Vector3d mean_of(std::span<const rig::Pose> poses) {
  Vector3d sum = Vector3d::Zero();
  for (const rig::Pose& pose : poses) sum += pose.position;
  return sum / static_cast<double>(poses.size());
}

/// Returns the sum of the squared distances of the centres from their mean; 0 if they are in one
/// place except for rounding.
double spread_around(const Vector3d& mean, std::span<const rig::Pose> poses) {
  constexpr double kRounding = 1e-13;  // of the mean, relative to its distance from the origin
  double farthest = 0, sum = 0;
  for (const rig::Pose& pose : poses) {
    const double square = (pose.position - mean).squaredNorm();
    farthest = std::max(farthest, square);
    sum += square;
  }
  return std::sqrt(farthest) > kRounding * mean.norm() ? sum : 0;
}

}  // namespace

SimilarityTransform estimate_similarity(std::span<const rig::Pose> from,
                                        std::span<const rig::Pose> to) {
  const Vector3d middle_from = mean_of(from), middle_to = mean_of(to);
  Matrix3d covariance = Matrix3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Vector3d a = from[i].position - middle_from, b = to[i].position - middle_to;
    covariance += b * a.transpose();
  }
  const double spread_from = spread_around(middle_from, from),
               spread_to = spread_around(middle_to, to);
  // Centres in one place, as those of a panoramic head, determine neither rotation nor scale.
  const bool has_spread = spread_from > 0 && spread_to > 0;
  if (!has_spread) covariance.setZero();
  // A direction has the weight of a centre at the mean distance. It determines the rotation that
  // centres on a line leave open.
  const double weight =
      has_spread ? std::sqrt(spread_from * spread_to) / static_cast<double>(from.size()) : 1;
  Matrix3d with_directions = covariance;
  for (std::size_t i = 0; i < from.size(); ++i) {
    with_directions +=
        weight * to[i].world_from_camera_rotation * from[i].world_from_camera_rotation.transpose();
  }
  const Eigen::JacobiSVD<Matrix3d> svd(with_directions, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3d mirror = Matrix3d::Identity();
  mirror(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  SimilarityTransform result;
  result.rotation = svd.matrixU() * mirror * svd.matrixV().transpose();
  if (has_spread) result.scale = (result.rotation.transpose() * covariance).trace() / spread_from;
  result.translation = middle_to - result.scale * (result.rotation * middle_from);
  return result;
}

void apply(const SimilarityTransform& similarity, ArrayModel& model) {
  for (ArrayModel::Camera& camera : model.cameras) {
    if (camera.pose) camera.pose = similarity(*camera.pose);
  }
  for (ArrayModel::RigidBody& body : model.bodies) {
    if (body.pose) body.pose = similarity(*body.pose);
    for (Eigen::Vector3d& point : body.points_in_body) point *= similarity.scale;
  }
  for (auto& point : model.points) {
    if (point) point = similarity(*point);
  }
}

}  // namespace raystage::calibrate
