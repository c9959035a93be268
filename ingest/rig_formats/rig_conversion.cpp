// SPDX-License-Identifier: Apache-2.0
#include "ingest/rig_formats/rig_conversion.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>

#include "schemas/projection_names.h"

namespace raystage::ingest {
namespace {

template <typename Has>
void add_loss(const schemas::RigDocument& rig, const Has& has, std::string_view what,
              std::vector<std::string>& notes) {
  const auto count = std::ranges::count_if(rig.cameras, has);
  if (count == 0) return;
  notes.push_back(
      fmt::format("the {} of {} camera{} are not in the file", what, count, count == 1 ? "" : "s"));
}

}  // namespace

bool make_rotation(Eigen::Matrix3d& axes, double tolerance, std::string& problem) {
  const double off = (axes.transpose() * axes - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(off <= tolerance)) {
    problem =
        fmt::format("the axes are not orthonormal, with an error of {:.3g}, allowed: up to {:.3g}",
                    off, tolerance);
    return false;
  }
  if (axes.determinant() < 0) {
    problem = "the axes are left-handed, allowed: right-handed axes";
    return false;
  }
  // Axes that are orthonormal to rounding keep their digits.
  constexpr double kRounding = 1e-14;
  if (off <= kRounding) return true;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(axes, Eigen::ComputeFullU | Eigen::ComputeFullV);
  axes = svd.matrixU() * svd.matrixV().transpose();
  return true;
}

rig::Pose pose_from_opencv(const Eigen::Matrix3d& camera_from_world_rotation,
                           const Eigen::Vector3d& position) {
  rig::Pose pose;
  pose.position = position;
  pose.world_from_camera_rotation =
      camera_from_world_rotation.transpose() * Eigen::Vector3d(1, -1, -1).asDiagonal();
  return pose;
}

Eigen::Matrix3d opencv_camera_from_world_rotation(const rig::Pose& pose) {
  const Eigen::Matrix3d world_from_camera =
      pose.world_from_camera_rotation * Eigen::Vector3d(1, -1, -1).asDiagonal();
  return world_from_camera.transpose();
}

Error lens_error(const schemas::CameraGeometry& camera, std::string_view why,
                 std::string_view advice) {
  return Error::bad_input(fmt::format("the {} lens cannot be written: {}",
                                      schemas::name_of(camera.intrinsics.projection), why),
                          fmt::format("camera \"{}\"", camera.id), std::string(advice));
}

std::vector<std::string> losses_of(const schemas::RigDocument& rig, FormatAbilities abilities) {
  using Camera = schemas::RigDocument::Camera;
  std::vector<std::string> notes;
  if (!abilities.half_angle) {
    add_loss(
        rig, [](const Camera& c) { return c.geometry.intrinsics.half_angle.has_value(); },
        "half angles", notes);
  }
  add_loss(
      rig, [](const Camera& c) { return c.geometry.line_time_us != 0; },
      "line times of the rolling shutters", notes);
  add_loss(
      rig, [](const Camera& c) { return !(c.photometric == schemas::PhotometricResponse{}); },
      "photometric responses", notes);
  add_loss(
      rig, [](const Camera& c) { return c.geometry.row.has_value(); }, "rows and columns", notes);
  return notes;
}

}  // namespace raystage::ingest
