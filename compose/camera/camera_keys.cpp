// SPDX-License-Identifier: Apache-2.0
// Finds keys that follow a camera's path: see find_camera_keys(). Frames in, keys out; the path is
// evaluated once per frame, the candidate keys once per frame and round.
#include "compose/camera/camera_keys.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

namespace raystage::compose {
namespace {

using Key = schemas::ShotDocument::CameraKey;

Key key_at(int frame, const CameraState& state, bool is_shifted) {
  const Eigen::Quaterniond q(state.pose.world_from_camera_rotation);
  const Eigen::Vector3d& p = state.pose.position;
  Key key;
  key.frame = frame;
  key.position = {p.x(), p.y(), p.z()};
  key.orientation = {q.w(), q.x(), q.y(), q.z()};
  key.focal_length_mm = state.focal_length_mm;
  if (is_shifted) {
    key.shift_x = state.shift_x;
    key.shift_y = state.shift_y;
  }
  key.focus_m = state.focus_m;
  key.f_number = state.f_number;
  key.shutter_deg = state.shutter_deg;
  return key;
}

/// Returns |a - b| if both are given, else 0: keys of one path all have a property, or none.
double difference(const std::optional<double>& a, const std::optional<double>& b) {
  return a && b ? std::abs(*a - *b) : 0;
}

std::optional<double> inverse(const std::optional<double>& value) {
  return value ? std::optional(1 / *value) : std::nullopt;
}

/// Returns the largest deviation of a state from the path's, in tolerances.
double deviation(const CameraState& path, const CameraState& keyed, const KeyTolerance& allowed) {
  constexpr double kDegrees = 180 / std::numbers::pi;
  const double turned =
      Eigen::Quaterniond(path.pose.world_from_camera_rotation)
          .angularDistance(Eigen::Quaterniond(keyed.pose.world_from_camera_rotation)) *
      kDegrees;
  return std::max(
      {(path.pose.position - keyed.pose.position).norm() / allowed.position_m,
       turned / allowed.rotation_deg,
       std::abs(path.focal_length_mm - keyed.focal_length_mm) /
           (allowed.focal_length_share * path.focal_length_mm),
       std::hypot(path.shift_x - keyed.shift_x, path.shift_y - keyed.shift_y) / allowed.shift,
       difference(inverse(path.focus_m), inverse(keyed.focus_m)) / allowed.focus_dioptres,
       difference(path.f_number, keyed.f_number) /
           (allowed.f_number_share * path.f_number.value_or(1)),
       difference(path.shutter_deg, keyed.shutter_deg) / allowed.shutter_deg});
}

}  // namespace

std::vector<Key> find_camera_keys(const ShotCamera& camera, const schemas::ShotDocument& shot,
                                  const KeyTolerance& tolerance) {
  std::vector<CameraState> path;
  for (int frame = shot.first_frame; frame <= shot.last_frame; ++frame) {
    path.push_back(camera.state(frame));
  }
  const bool is_shifted = std::ranges::any_of(
      path, [](const CameraState& state) { return state.shift_x != 0 || state.shift_y != 0; });
  std::vector<std::size_t> chosen{0};
  if (path.size() > 1) chosen.push_back(path.size() - 1);
  for (;;) {
    std::vector<Key> keys;
    for (const std::size_t i : chosen) {
      keys.push_back(key_at(shot.first_frame + static_cast<int>(i), path[i], is_shifted));
    }
    schemas::ShotDocument keyed = shot;
    keyed.camera = keyed_camera(shot.camera, keys);
    const ShotCamera candidate(keyed, {});
    std::vector<std::size_t> added;
    for (std::size_t k = 0; k + 1 < chosen.size(); ++k) {
      double worst = 1;
      std::optional<std::size_t> at;
      for (std::size_t i = chosen[k] + 1; i < chosen[k + 1]; ++i) {
        const double off = deviation(
            path[i], candidate.state(shot.first_frame + static_cast<double>(i)), tolerance);
        if (off > worst) {
          worst = off;
          at = i;
        }
      }
      if (at) added.push_back(*at);
    }
    if (added.empty()) return keys;
    chosen.insert(chosen.end(), added.begin(), added.end());
    std::ranges::sort(chosen);
  }
}

schemas::ShotDocument::Camera keyed_camera(const schemas::ShotDocument::Camera& camera,
                                           std::vector<Key> keys) {
  schemas::ShotDocument::Camera keyed = camera;
  keyed.keys = std::move(keys);
  keyed.file.reset();
  keyed.orbit.reset();
  keyed.dolly_zoom.reset();
  return keyed;
}

}  // namespace raystage::compose
