// SPDX-License-Identifier: Apache-2.0
// Makes the simulated array: a planar grid as designed, and the same with random mounting errors
// (uniform in a ball), lens deviations (normal) and colour errors. The random numbers are hashes of
// the seed and the camera's index (hash_random.h). Cost: constant per camera.
#include "simulate/simulated_rig.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "rig/pose.h"
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

SimulatedRig make_simulated_rig(const SimulationOptions& s) {
  const rig::Pose of_array = simulated_rig_pose(s);
  SimulatedRig array;
  array.nominal.name = fmt::format("simulated {}x{}", s.rows, s.columns);
  array.nominal.topology = "grid";
  array.truth.name = array.nominal.name;
  array.truth.topology = array.nominal.topology;
  const double focal = s.width / 2.0 / std::tan(s.horizontal_fov_deg * std::numbers::pi / 360);
  for (int row = 0; row < s.rows; ++row) {
    for (int column = 0; column < s.columns; ++column) {
      schemas::RigDocument::Camera camera;
      schemas::CameraGeometry& geometry = camera.geometry;
      geometry.id = fmt::format("r{}c{}", row, column);
      geometry.width = s.width;
      geometry.height = s.height;
      geometry.intrinsics = {focal, focal, s.width / 2.0, s.height / 2.0, {s.k1, s.k2, 0, 0, 0}};
      geometry.row = row;
      geometry.column = column;
      rig::Pose pose = of_array;
      pose.position = of_array.world_from_camera(Eigen::Vector3d(
          s.spacing * (column - (s.columns - 1) / 2.0), s.spacing * ((s.rows - 1) / 2.0 - row), 0));
      geometry.world_from_camera = rig::matrix_from_pose(pose);
      array.nominal.cameras.push_back(camera);

      const auto index = static_cast<std::uint64_t>(row * s.columns + column);
      HashRandom place{s.seed, kPlaceSalt, index};
      pose.position += s.mounting_error * in_ball(place);
      const Eigen::Vector3d turn = s.mounting_error_deg * std::numbers::pi / 180 * in_ball(place);
      if (turn.norm() > 0) {
        pose.world_from_camera_rotation =
            of_array.world_from_camera_rotation *
            Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
      }
      geometry.world_from_camera = rig::matrix_from_pose(pose);
      HashRandom lens{s.seed, kLensSalt, index};
      schemas::Intrinsics& intrinsics = geometry.intrinsics;
      intrinsics.fx *= 1 + s.lens_deviation * 0.003 * lens.normal();
      intrinsics.fy = intrinsics.fx;
      intrinsics.cx += s.lens_deviation * 0.006 * s.width * lens.normal();
      intrinsics.cy += s.lens_deviation * 0.006 * s.width * lens.normal();
      intrinsics.distortion.k1 += s.lens_deviation * 0.01 * lens.normal();
      intrinsics.distortion.k2 += s.lens_deviation * 0.01 * lens.normal();
      camera.photometric = simulated_response(s, index);
      array.truth.cameras.push_back(camera);
    }
  }
  return array;
}

}  // namespace raystage::simulate
