// SPDX-License-Identifier: Apache-2.0
// Moves the path of a camera into the range of motion of ideal arrays. The ranges are convex, one
// for each frame. Smoothing the shifts over the frames and projecting each position back onto its
// ranges, in turns, is the method of alternating projections. It ends with a projection, so that
// every position is in its ranges. Cost: rounds x frames x faces.
#include "planning/nearest_path.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "base/error.h"
#include "rig/planning/range_of_motion.h"
#include "rig/planning/wall_eyed_array.h"

namespace raystage::planning {
namespace {

using Eigen::Vector3d;

/// Where the centre between the eyes may be so that an eye is in its range of motion.
struct EyeRange {
  rig::ConvexPolyhedron positions;  ///< of the eye, in the frame of `array`
  const rig::WallEyedArray* array = nullptr;
  Vector3d eye_offset = Vector3d::Zero();  ///< from the centre, world

  Vector3d projected(const Vector3d& centre) const {
    const rig::Pose& pose = array->pose;
    const Vector3d in_array =
        pose.world_from_camera_rotation.transpose() * (centre + eye_offset - pose.position);
    if (positions.signed_distance(in_array) >= 0) return centre;
    return pose.world_from_camera_rotation * positions.nearest_point(in_array) + pose.position -
           eye_offset;
  }
};

struct PathFrame {
  int frame = 0;
  Vector3d position = Vector3d::Zero();  ///< of the given path, world
  std::vector<EyeRange> ranges;

  /// Returns the nearest position that is in all ranges.
  Vector3d projected(Vector3d centre) const {
    constexpr int kRounds = 40;  // of alternating projections; one range needs one
    for (int round = 0; round < kRounds; ++round) {
      const Vector3d before = centre;
      for (const EyeRange& range : ranges) centre = range.projected(centre);
      if ((centre - before).norm() < 1e-12 || ranges.size() == 1) break;
    }
    return centre;
  }
};

std::vector<PathFrame> frames_of(const compose::ShotPlan& plan, const std::string& name,
                                 std::span<const compose::PlannedFrame> frames,
                                 const std::vector<rig::WallEyedArray>& arrays) {
  std::vector<PathFrame> path;
  for (const compose::PlannedFrame& planned : frames) {
    PathFrame frame;
    frame.frame = planned.frame;
    frame.position = plan.shot_camera().state(planned.frame).pose.position;
    for (const compose::Eye eye : plan.eyes()) {
      const render::VirtualCamera view = plan.camera(planned.frame, eye);
      const rig::ViewFrustum frustum{rig::camera_slopes(view.intrinsics, view.width, view.height),
                                     view.pose.world_from_camera_rotation};
      for (const rig::WallEyedArray& array : arrays) {
        rig::RangeOfMotion range = rig::range_of_motion(array, frustum);
        if (range.positions.is_empty()) {
          throw Error::bad_input(fmt::format("no position has the view of frame {}: {}",
                                             planned.frame, range.empty_because),
                                 name,
                                 "Turn the camera towards the array, or narrow its field of view");
        }
        frame.ranges.push_back(
            {std::move(range.positions), &array, view.pose.position - frame.position});
      }
    }
    path.push_back(std::move(frame));
  }
  return path;
}

/// Replaces each shift by a weighted mean over its neighbours; the ends repeat.
std::vector<Vector3d> smoothed(const std::vector<Vector3d>& shifts) {
  constexpr std::array<double, 5> kWeights{1 / 16.0, 4 / 16.0, 6 / 16.0, 4 / 16.0, 1 / 16.0};
  std::vector<Vector3d> result(shifts.size());
  const auto last = static_cast<std::ptrdiff_t>(shifts.size()) - 1;
  for (std::ptrdiff_t i = 0; i <= last; ++i) {
    result[i].setZero();
    for (std::ptrdiff_t k = -2; k <= 2; ++k) {
      result[i] += kWeights[k + 2] * shifts[std::clamp<std::ptrdiff_t>(i + k, 0, last)];
    }
  }
  return result;
}

std::array<double, 4> quaternion_of(const Eigen::Matrix3d& rotation) {
  const Eigen::Quaterniond q(rotation);
  return {q.w(), q.x(), q.y(), q.z()};
}

schemas::ShotDocument::CameraKey key_at(const compose::ShotCamera& camera, int frame,
                                        const Vector3d& position) {
  const compose::CameraState state = camera.state(frame);
  schemas::ShotDocument::CameraKey key;
  key.frame = frame;
  key.position = std::array{position.x(), position.y(), position.z()};
  key.orientation = quaternion_of(state.pose.world_from_camera_rotation);
  key.focal_length_mm = state.focal_length_mm;
  if (state.shift_x != 0) key.shift_x = state.shift_x;
  if (state.shift_y != 0) key.shift_y = state.shift_y;
  key.focus_m = state.focus_m;
  key.f_number = state.f_number;
  key.shutter_deg = state.shutter_deg;
  return key;
}

}  // namespace

NearestPath find_nearest_path(const compose::ShotPlan& plan, const std::string& name,
                              std::span<const compose::PlannedFrame> frames) {
  std::vector<rig::WallEyedArray> arrays;
  std::string reason = "no light field is visible";
  for (const compose::LightFieldLayer* light_field : plan.light_fields()) {
    const rig::Rig& rig = light_field->take().rig();
    auto array = rig::find_wall_eyed_array(rig);
    if (!array) {
      std::vector<int> all(rig.cameras.size());
      std::iota(all.begin(), all.end(), 0);
      array = rig::inscribed_wall_eyed_array(rig, rig::make_topology(rig, all), &reason);
    }
    if (array) arrays.push_back(std::move(*array));
  }
  if (arrays.empty()) {
    throw Error::bad_input("no range of motion is known: " + reason, name,
                           "Move the camera by hand, and check the shot again");
  }
  const std::vector<PathFrame> path = frames_of(plan, name, frames, arrays);
  std::vector<Vector3d> shifts(path.size(), Vector3d::Zero());
  constexpr int kRounds = 8;  // a shift extends over some eight frames before and after
  for (int round = 0; round < kRounds; ++round) {
    if (round > 0) shifts = smoothed(shifts);
    for (std::size_t i = 0; i < path.size(); ++i) {
      shifts[i] = path[i].projected(path[i].position + shifts[i]) - path[i].position;
    }
  }
  NearestPath result;
  result.shot = plan.shot();
  schemas::ShotDocument::Camera& camera = result.shot.camera;
  camera.keys.clear();
  camera.file.reset();
  camera.orbit.reset();
  camera.dolly_zoom.reset();
  for (std::size_t i = 0; i < path.size(); ++i) {
    camera.keys.push_back(key_at(plan.shot_camera(), path[i].frame, path[i].position + shifts[i]));
    if (shifts[i].norm() > result.largest_shift) {
      result.largest_shift = shifts[i].norm();
      result.largest_shift_frame = path[i].frame;
    }
  }
  return result;
}

}  // namespace raystage::planning
