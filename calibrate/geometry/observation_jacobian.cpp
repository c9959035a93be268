// SPDX-License-Identifier: Apache-2.0
// Derivatives of observations by poses, lenses and points (automatic differentiation of the lens
// model), and the elimination of points from the normal equations (Schur complement, by an
// orthonormal basis). Cost: observations per point squared.
#include "calibrate/geometry/observation_jacobian.h"

#include <ceres/jet.h>

#include <Eigen/Dense>

#include "calibrate/geometry/lens_projection.h"

namespace raystage::calibrate {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

/// Jacobian of a pixel by the point in the camera (3) and the lens (9).
using LensJacobian = Eigen::Matrix<double, 2, 3 + kLensParameterCount>;

LensJacobian lens_jacobian(const Vector3d& in_camera, const schemas::Intrinsics& lens,
                           bool square_pixels) {
  using Jet = ceres::Jet<double, 3 + kLensParameterCount>;
  Eigen::Matrix<Jet, 3, 1> point;
  for (int i = 0; i < 3; ++i) point[i] = Jet(in_camera[i], i);
  std::array<Jet, kLensParameterCount> values;
  const LensParameters plain = lens_parameters(lens);
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = Jet(plain[i], 3 + static_cast<int>(i));
  const Eigen::Matrix<Jet, 2, 1> pixel =
      project_to_pixel<Jet>(point, values.data(), fisheye_projection(lens), square_pixels);
  LensJacobian jacobian;
  jacobian.row(0) = pixel.x().v.transpose();
  jacobian.row(1) = pixel.y().v.transpose();
  return jacobian;
}

}  // namespace

Matrix3d cross_matrix(const Vector3d& v) {
  Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

ObservationRows observation_rows(const ArrayModel& model, const ArrayModel::Observation& o,
                                 const ParameterLayout& layout) {
  const auto i = static_cast<std::size_t>(o.camera);
  const ArrayModel::Camera& camera = model.cameras[i];
  const Vector3d in_camera = camera.pose->camera_from_world(*model.points[o.point]);
  const LensJacobian jacobian = lens_jacobian(in_camera, camera.intrinsics, layout.square_pixels);
  const Eigen::Matrix<double, 2, 3> by_place = jacobian.leftCols<3>();
  const Matrix3d camera_from_world = camera.pose->world_from_camera_rotation.transpose();
  ObservationRows rows;
  rows.by_point = by_place * camera_from_world;
  const Index of_pose = layout.pose[i] == kFixed ? 0 : kPoseParameterCount;
  const Index of_lens =
      layout.lens[i] == kFixed ? 0 : static_cast<Index>(layout.free_lens_parameters[i].size());
  rows.by_unknowns.resize(2, of_pose + of_lens);
  if (of_pose != 0) {
    rows.by_unknowns.leftCols<3>() = -by_place * cross_matrix(in_camera);
    rows.by_unknowns.middleCols<3>(3) = -rows.by_point;
    for (Index k = 0; k < of_pose; ++k) rows.unknowns.push_back(layout.pose[i] + k);
  }
  for (Index k = 0; k < of_lens; ++k) {
    rows.by_unknowns.col(of_pose + k) = jacobian.col(3 + layout.free_lens_parameters[i][k]);
    rows.unknowns.push_back(layout.lens[i] + k);
  }
  return rows;
}

void ReducedNormalEquations::add(const std::vector<ObservationRows>& rows,
                                 const MatrixXd& by_common,
                                 std::span<const Eigen::Vector2d> residuals) {
  // Elimination removes the column space of the derivatives. The orthonormal basis is well
  // conditioned even for distant points, whose depth moves pixels little.
  const Eigen::HouseholderQR<MatrixXd> qr(by_common);
  const MatrixXd basis = qr.householderQ() * MatrixXd::Identity(by_common.rows(), by_common.cols());
  std::vector<MatrixXd> across;  // parameters x basis
  for (std::size_t k = 0; k < rows.size(); ++k) {
    across.emplace_back(rows[k].by_unknowns.transpose() *
                        basis.middleRows<2>(2 * static_cast<Index>(k)));
  }
  VectorXd in_basis = VectorXd::Zero(by_common.cols());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    in_basis += basis.middleRows<2>(2 * static_cast<Index>(k)).transpose() * residuals[k];
    squared_error += residuals[k].squaredNorm();
  }
  observations += static_cast<int>(rows.size());
  eliminated += static_cast<int>(by_common.cols());
  for (std::size_t a = 0; a < rows.size(); ++a) {
    const VectorXd of_right = rows[a].by_unknowns.transpose() * residuals[a] - across[a] * in_basis;
    for (Index row = 0; row < of_right.size(); ++row) {
      right[rows[a].unknowns[row]] += of_right[row];
    }
    for (std::size_t b = 0; b < rows.size(); ++b) {
      MatrixXd block = -across[a] * across[b].transpose();
      if (a == b) block += rows[a].by_unknowns.transpose() * rows[a].by_unknowns;
      for (Index row = 0; row < block.rows(); ++row) {
        for (Index column = 0; column < block.cols(); ++column) {
          matrix(rows[a].unknowns[row], rows[b].unknowns[column]) += block(row, column);
        }
      }
    }
  }
}

}  // namespace raystage::calibrate
