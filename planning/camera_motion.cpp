// SPDX-License-Identifier: Apache-2.0
#include "planning/camera_motion.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>

namespace raystage::planning {
namespace {

using Eigen::Vector3d;

constexpr double kDegreesPerRadian = 180 / std::numbers::pi;

void raise(PathExtreme& extreme, double value, int frame) {
  if (value > extreme.value) extreme = {value, frame};
}

/// Returns the direction in which positions extend most.
Vector3d track_direction(std::span<const FramePose> poses) {
  Vector3d mean = Vector3d::Zero();
  for (const FramePose& at : poses) mean += at.pose.position / static_cast<double>(poses.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const FramePose& at : poses) {
    const Vector3d offset = at.pose.position - mean;
    scatter += offset * offset.transpose();
  }
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvectors().col(2);
}

}  // namespace

bool MotionLimits::is_limited() const {
  return std::isfinite(std::min({reach, extension_speed, track_speed, acceleration, turn_speed}));
}

MotionLimits milo_motion_limits() {
  MotionLimits limits;
  limits.reach = 1;
  limits.extension_speed = 0.38;
  limits.track_speed = 2;
  limits.turn_speed = 120 / kDegreesPerRadian;
  return limits;
}

CameraMotion measure_motion(std::span<const FramePose> poses, double fps) {
  CameraMotion motion;
  const Vector3d track = track_direction(poses);
  const auto across = [&](const Vector3d& offset) -> Vector3d {
    return offset - offset.dot(track) * track;
  };
  double least = std::numeric_limits<double>::infinity(), most = -least;
  Vector3d middle = Vector3d::Zero();
  for (const FramePose& at : poses) {
    least = std::min(least, at.pose.position.dot(track));
    most = std::max(most, at.pose.position.dot(track));
    middle += at.pose.position / static_cast<double>(poses.size());
  }
  motion.track_length = most - least;
  for (const FramePose& at : poses) {
    motion.reach = std::max(motion.reach, 2 * across(at.pose.position - middle).norm());
  }
  Vector3d velocity = Vector3d::Zero();  // between the last two frames
  bool has_velocity = false;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const FramePose &from = poses[i - 1], &to = poses[i];
    if (to.frame != from.frame + 1) {
      has_velocity = false;
      continue;
    }
    const Vector3d speed = (to.pose.position - from.pose.position) * fps;
    raise(motion.track_speed, std::abs(speed.dot(track)), to.frame);
    raise(motion.extension_speed, across(speed).norm(), to.frame);
    const Eigen::AngleAxisd turn(from.pose.world_from_camera_rotation.transpose() *
                                 to.pose.world_from_camera_rotation);
    raise(motion.turn_speed, std::abs(turn.angle()) * fps, to.frame);
    if (has_velocity) raise(motion.acceleration, (speed - velocity).norm() * fps, from.frame);
    velocity = speed;
    has_velocity = true;
  }
  return motion;
}

std::vector<std::string> exceeded_limits(const CameraMotion& motion, const MotionLimits& limits) {
  std::vector<std::string> sentences;
  if (motion.reach > limits.reach + kLeastMotion) {
    sentences.push_back(
        fmt::format("The path is up to {:.3g} m wide across the track; the arm "
                    "reaches {:.3g} m.",
                    motion.reach, limits.reach));
  }
  const auto compare = [&](std::string_view what, const PathExtreme& extreme, double limit,
                           double scale, std::string_view unit) {
    if (!(extreme.value > limit + kLeastMotion)) return;
    sentences.push_back(fmt::format("{} is up to {:.3g} {} at frame {}; the rig does {:.3g} {}.",
                                    what, extreme.value * scale, unit, extreme.frame, limit * scale,
                                    unit));
  };
  compare("The speed along the track", motion.track_speed, limits.track_speed, 1, "m/s");
  compare("The speed across the track", motion.extension_speed, limits.extension_speed, 1, "m/s");
  compare("The acceleration", motion.acceleration, limits.acceleration, 1, "m/s2");
  compare("The rotation", motion.turn_speed, limits.turn_speed, kDegreesPerRadian, "deg/s");
  return sentences;
}

}  // namespace raystage::planning
