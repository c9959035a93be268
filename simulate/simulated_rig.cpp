// SPDX-License-Identifier: Apache-2.0
// Makes the simulated array: a planar grid or a given rig as designed, and the same with random
// mounting errors (uniform in a ball), lens deviations (normal) and colour errors. The random
// numbers are hashes of the seed and the camera's index (hash_random.h). Cost: constant per camera.
#include "simulate/simulated_rig.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "rig/pose.h"
#include "rig/radial_projection.h"
#include "simulate/hash_random.h"
#include "simulate/simulated_response.h"

namespace raystage::simulate {
namespace {

constexpr std::uint64_t kPlaceSalt = 1, kLensSalt = 2;

// Returns a point that is uniformly distributed in the unit ball.
Eigen::Vector3d in_ball(HashRandom& random) {
  for (;;) {
    const double x = random.uniform(-1, 1), y = random.uniform(-1, 1), z = random.uniform(-1, 1);
    const Eigen::Vector3d point(x, y, z);
    if (point.squaredNorm() <= 1) return point;
  }
}

}  // namespace

rig::Pose simulated_rig_pose(const SimulationOptions& s) {
  rig::Pose pose;
  pose.position = {s.position[0], s.position[1], s.position[2]};
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(s.turn_deg * std::numbers::pi / 180, Eigen::Vector3d::UnitY())
          .toRotationMatrix();
  return pose;
}

namespace {

/// Returns the lens of a grid's cameras as designed.
schemas::Intrinsics designed_lens(const SimulationOptions& s) {
  const double half = s.horizontal_fov_deg * std::numbers::pi / 360;
  const bool is_pinhole = s.lens == schemas::Projection::kPinhole;
  const double distance =  // of the picture's side, focal lengths
      is_pinhole ? std::tan(half) : rig::radial_projection(s.lens).distance(half);
  const double focal = s.width / 2.0 / distance;
  schemas::Intrinsics lens{focal, focal, s.width / 2.0, s.height / 2.0, {}};
  lens.projection = s.lens;
  if (is_pinhole) {
    lens.distortion = {s.k1, s.k2, 0, 0, 0};
  } else {
    lens.radial_distortion = {s.k1, s.k2, 0, 0};
  }
  return lens;
}

schemas::RigDocument designed_grid(const SimulationOptions& s) {
  const rig::Pose of_array = simulated_rig_pose(s);
  schemas::RigDocument grid;
  grid.name = fmt::format("simulated {}x{}", s.rows, s.columns);
  grid.topology = "grid";
  for (int row = 0; row < s.rows; ++row) {
    for (int column = 0; column < s.columns; ++column) {
      schemas::RigDocument::Camera camera;
      schemas::CameraGeometry& geometry = camera.geometry;
      geometry.id = fmt::format("r{}c{}", row, column);
      geometry.width = s.width;
      geometry.height = s.height;
      geometry.intrinsics = designed_lens(s);
      geometry.row = row;
      geometry.column = column;
      rig::Pose pose = of_array;
      pose.position = of_array.world_from_camera(Eigen::Vector3d(
          s.spacing * (column - (s.columns - 1) / 2.0), s.spacing * ((s.rows - 1) / 2.0 - row), 0));
      geometry.world_from_camera = rig::matrix_from_pose(pose);
      grid.cameras.push_back(camera);
    }
  }
  return grid;
}

/// Returns the given rig at the array's pose, with pictures of the simulation's width.
schemas::RigDocument given_design(const SimulationOptions& s) {
  const rig::Pose of_array = simulated_rig_pose(s);
  schemas::RigDocument design = *s.given_rig;
  for (schemas::RigDocument::Camera& camera : design.cameras) {
    schemas::CameraGeometry& geometry = camera.geometry;
    const double scale = static_cast<double>(s.width) / geometry.width;
    geometry.height = std::max(1, static_cast<int>(std::lround(geometry.height * scale)));
    geometry.width = s.width;
    for (double* length : {&geometry.intrinsics.fx, &geometry.intrinsics.fy,
                           &geometry.intrinsics.cx, &geometry.intrinsics.cy}) {
      *length *= scale;
    }
    geometry.line_time_us = s.line_time_us ? 0 : geometry.line_time_us / scale;
    rig::Pose pose = rig::pose_from_matrix(geometry.world_from_camera);
    pose.position = of_array.world_from_camera(pose.position);
    pose.world_from_camera_rotation =
        of_array.world_from_camera_rotation * pose.world_from_camera_rotation;
    geometry.world_from_camera = rig::matrix_from_pose(pose);
    camera.photometric = {};
  }
  return design;
}

}  // namespace

SimulatedRig make_simulated_rig(const SimulationOptions& s) {
  SimulatedRig array;
  array.nominal = s.given_rig ? given_design(s) : designed_grid(s);
  array.truth = array.nominal;
  for (std::size_t i = 0; i < array.truth.cameras.size(); ++i) {
    schemas::RigDocument::Camera& camera = array.truth.cameras[i];
    schemas::CameraGeometry& geometry = camera.geometry;
    rig::Pose pose = rig::pose_from_matrix(geometry.world_from_camera);
    const auto index = static_cast<std::uint64_t>(i);
    HashRandom place{s.seed, kPlaceSalt, index};
    pose.position += s.mounting_error * in_ball(place);
    const Eigen::Vector3d turn = s.mounting_error_deg * std::numbers::pi / 180 * in_ball(place);
    if (turn.norm() > 0) {
      pose.world_from_camera_rotation *=
          Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
    }
    geometry.world_from_camera = rig::matrix_from_pose(pose);
    geometry.line_time_us = s.line_time_us.value_or(geometry.line_time_us);
    HashRandom lens{s.seed, kLensSalt, index};
    schemas::Intrinsics& intrinsics = geometry.intrinsics;
    const double longer = 1 + s.lens_deviation * 0.003 * lens.normal();
    intrinsics.fx *= longer;
    intrinsics.fy *= longer;
    intrinsics.cx += s.lens_deviation * 0.006 * s.width * lens.normal();
    intrinsics.cy += s.lens_deviation * 0.006 * s.width * lens.normal();
    const bool is_pinhole = intrinsics.projection == schemas::Projection::kPinhole;
    (is_pinhole ? intrinsics.distortion.k1 : intrinsics.radial_distortion[0]) +=
        s.lens_deviation * 0.01 * lens.normal();
    (is_pinhole ? intrinsics.distortion.k2 : intrinsics.radial_distortion[1]) +=
        s.lens_deviation * 0.01 * lens.normal();
    camera.photometric = simulated_response(s, index);
  }
  return array;
}

}  // namespace raystage::simulate
