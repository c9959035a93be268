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
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "base/error.h"
#include "planning/complete_topology.h"
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

  Vector3d in_array(const Vector3d& centre) const {
    return array->pose.world_from_camera_rotation.transpose() *
           (centre + eye_offset - array->pose.position);
  }
  Vector3d projected(const Vector3d& centre) const {
    const Vector3d point = in_array(centre);
    if (positions.signed_distance(point) >= 0) return centre;
    return array->pose.world_from_camera(positions.nearest_point(point)) - eye_offset;
  }
};

/// The ranges of the eyes before one take.
using TakeRanges = std::vector<EyeRange>;

/// Takes of which one must have recorded the view: those around a volume, or a single one.
using Alternatives = std::vector<TakeRanges>;

struct PathFrame {
  int frame = 0;
  Vector3d position = Vector3d::Zero();  ///< of the given path, world
  std::vector<Alternatives> takes;

  /// Returns a position near to `centre` that is in the ranges of a take of each group.
  Vector3d projected(Vector3d centre) const {
    constexpr int kRounds = 40;  // of alternating projections; one range needs one
    for (int round = 0; round < kRounds; ++round) {
      const Vector3d before = centre;
      for (const Alternatives& group : takes) centre = projected(group, centre);
      if ((centre - before).norm() < 1e-12) break;
    }
    return centre;
  }

  /// Returns how far a position is outside of the ranges, metres; at most 0 inside.
  double distance_outside(const Vector3d& centre) const {
    double outside = -std::numeric_limits<double>::infinity();
    for (const Alternatives& group : takes) {
      double best = std::numeric_limits<double>::infinity();
      for (const TakeRanges& eyes : group) {
        double worst = -std::numeric_limits<double>::infinity();
        for (const EyeRange& eye : eyes) {
          worst = std::max(worst, -eye.positions.signed_distance(eye.in_array(centre)));
        }
        best = std::min(best, worst);
      }
      outside = std::max(outside, best);
    }
    return outside;
  }

 private:
  static Vector3d projected(const Alternatives& group, const Vector3d& centre) {
    Vector3d nearest = centre;
    double least = std::numeric_limits<double>::infinity();
    for (const TakeRanges& eyes : group) {
      Vector3d found = centre;
      for (const EyeRange& eye : eyes) found = eye.projected(found);
      const double distance = (found - centre).norm();
      if (distance >= least) continue;
      least = distance;
      nearest = found;
    }
    return nearest;
  }
};

/// The array of a take, by its layer; those whose range of motion is not known are left out.
using Arrays = std::map<std::size_t, rig::WallEyedArray>;

Arrays arrays_of(const compose::ShotPlan& plan, NearestPath& result) {
  Arrays arrays;
  for (const compose::LightFieldLayer* light_field : plan.light_fields()) {
    if (plan.is_light(light_field->index())) continue;
    const rig::Rig& rig = light_field->take().rig();
    std::string reason;
    if (auto recorded = rig::recorded_array(rig, &reason)) {
      arrays.emplace(light_field->index(), std::move(recorded->array));
    } else {
      result.ignored_takes.push_back(fmt::format("layer {}: {}", light_field->index(), reason));
    }
  }
  return arrays;
}

/// Returns the ranges of all eyes before a take; empty where one has none, because of `reason`.
TakeRanges ranges_before(const rig::WallEyedArray& array, const compose::ShotPlan& plan,
                         const PathFrame& frame, std::string& reason) {
  TakeRanges ranges;
  for (const compose::Eye eye : plan.eyes()) {
    const render::VirtualCamera view = plan.camera(frame.frame, eye);
    const rig::ViewFrustum frustum{rig::camera_slopes(view.intrinsics, view.width, view.height),
                                   view.pose.world_from_camera_rotation};
    rig::RangeOfMotion range = rig::range_of_motion(array, frustum);
    if (range.positions.is_empty()) {
      reason = range.empty_because;
      return {};
    }
    ranges.push_back({std::move(range.positions), &array, view.pose.position - frame.position});
  }
  return ranges;
}

PathFrame frame_of_path(const compose::ShotPlan& plan, const std::string& name, int number,
                        const Arrays& arrays) {
  PathFrame frame;
  frame.frame = number;
  frame.position = plan.shot_camera().state(number).pose.position;
  std::map<std::string, Alternatives> groups;
  std::map<std::string, std::string> reasons;
  for (const auto& [layer, array] : arrays) {
    if (!plan.is_visible(layer, number)) continue;
    const std::string& volume = plan.shot().layers[layer].volume;
    const std::string group = volume.empty() ? fmt::format("{}", layer) : "volume " + volume;
    TakeRanges ranges = ranges_before(array, plan, frame, reasons[group]);
    groups[group];
    if (!ranges.empty()) groups[group].push_back(std::move(ranges));
  }
  for (auto& [group, alternatives] : groups) {
    if (alternatives.empty()) {
      throw Error::bad_input(
          fmt::format("no position has the view of frame {}: {}", number, reasons[group]), name,
          "Turn the camera towards the array, or make its field of view narrower");
    }
    frame.takes.push_back(std::move(alternatives));
  }
  return frame;
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
                              const std::stop_token& stop) {
  NearestPath result;
  const Arrays arrays = arrays_of(plan, result);
  if (arrays.empty()) {
    throw Error::bad_input("no range of motion is known", name,
                           "Move the camera by hand, and check the shot again");
  }
  std::vector<PathFrame> path;
  for (int frame = plan.shot().first_frame; frame <= plan.shot().last_frame; ++frame) {
    if (stop.stop_requested()) throw Error::failed("the search was stopped", name, "");
    path.push_back(frame_of_path(plan, name, frame, arrays));
  }
  std::vector<Vector3d> shifts(path.size(), Vector3d::Zero());
  constexpr int kRounds = 8;  // a shift extends over some eight frames before and after
  for (int round = 0; round < kRounds; ++round) {
    if (round > 0) shifts = smoothed(shifts);
    for (std::size_t i = 0; i < path.size(); ++i) {
      if (stop.stop_requested()) throw Error::failed("the search was stopped", name, "");
      shifts[i] = path[i].projected(path[i].position + shifts[i]) - path[i].position;
    }
  }
  result.shot = plan.shot();
  schemas::ShotDocument::Camera& camera = result.shot.camera;
  camera.keys.clear();
  camera.file.reset();
  camera.orbit.reset();
  camera.dolly_zoom.reset();
  for (std::size_t i = 0; i < path.size(); ++i) {
    const Vector3d position = path[i].position + shifts[i];
    constexpr double kInside = 1e-6;  // metres
    if (path[i].distance_outside(position) > kInside) {
      throw Error::bad_input(
          fmt::format("no position was found that has the view of frame {} before all takes and "
                      "for both eyes",
                      path[i].frame),
          name, "Make the field of view narrower, or the eyes closer");
    }
    camera.keys.push_back(key_at(plan.shot_camera(), path[i].frame, position));
    if (shifts[i].norm() > result.largest_shift) {
      result.largest_shift = shifts[i].norm();
      result.largest_shift_frame = path[i].frame;
    }
  }
  return result;
}

}  // namespace raystage::planning
