// SPDX-License-Identifier: Apache-2.0
// Measures how an array samples rays along one of its axes. Cameras are turned into the frame of
// the array's plane; a camera with the rotation r and the slope e of a pixel in its own frame has
// the ray slope tan(r + atan(e)). Skewed cameras (thesis eq. 5.18) are parallel, and the slope of
// the middle of each frustum is -x / f_fixed for the camera at x: a line is fitted to these.
#include "rig/planning/camera_row.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <vector>

#include "base/error.h"
#include "rig/array_plane.h"
#include "rig/plenoptic_sampling.h"

namespace raystage::rig {
namespace {

/// A camera as seen along one axis of the array.
struct AxisCamera {
  double position = 0;            ///< metres along the axis
  double rotation = 0;            ///< radians
  double pitch = 0;               ///< of a pixel, at focal length 1
  double least = 0, largest = 0;  ///< slopes of the borders of the frame, in the camera's frame
};

double ray_slope(const AxisCamera& camera, double slope) {
  return std::tan(camera.rotation + std::atan(slope));
}

/// Fits slope = -position / distance + constant. Returns the distance, infinite for unskewed
/// cameras, and nullopt if the cameras do not fit within a tenth of a pixel.
std::optional<double> fixed_focal_distance(const std::vector<AxisCamera>& cameras) {
  const auto count = static_cast<double>(cameras.size());
  double mean_position = 0, mean_slope = 0;
  for (const AxisCamera& camera : cameras) {
    mean_position += camera.position / count;
    mean_slope += (camera.least + camera.largest) / 2 / count;
  }
  double products = 0, squares = 0;
  for (const AxisCamera& camera : cameras) {
    const double from_mean = camera.position - mean_position;
    products += from_mean * ((camera.least + camera.largest) / 2 - mean_slope);
    squares += from_mean * from_mean;
  }
  const double gradient = squares > 0 ? products / squares : 0;
  constexpr double kTolerance = 0.1;  // pixels
  for (const AxisCamera& camera : cameras) {
    const double fitted = mean_slope + gradient * (camera.position - mean_position);
    if (std::abs((camera.least + camera.largest) / 2 - fitted) > kTolerance * camera.pitch) {
      return std::nullopt;
    }
  }
  const double extent = std::sqrt(squares / count);
  const bool is_straight = std::abs(gradient) * extent <= kTolerance * cameras.front().pitch;
  return is_straight ? std::numeric_limits<double>::infinity() : -1 / gradient;
}

}  // namespace

ArraySampling measure_sampling(const Rig& rig, ArrayAxis axis) {
  if (rig.cameras.empty()) throw Error::bad_input("the rig has no cameras", "", "Add some");
  std::vector<Eigen::Vector3d> centres, directions;
  std::vector<int> all(rig.cameras.size());
  std::iota(all.begin(), all.end(), 0);
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const Rig::Camera& camera : rig.cameras) {
    centres.push_back(camera.pose.position);
    directions.push_back(camera.pose.viewing_direction());
    up += camera.pose.world_from_camera_rotation.col(1);
  }
  // The plane of the array; for a row or a single camera, the one across the viewing direction.
  const ArrayPlane plane = fit_array_plane(centres, directions);
  Eigen::Vector3d ahead = rig.mean_viewing_direction();
  if (plane.dimension == 2) ahead = -plane.normal;
  const Eigen::Vector3d right = ahead.cross(up).normalized();
  const bool is_horizontal = axis == ArrayAxis::kHorizontal;
  const Eigen::Vector3d along = is_horizontal ? right : Eigen::Vector3d(right.cross(ahead));

  ArraySampling result;
  result.row.spacing = max_neighbour_baseline(rig, make_topology(rig, all));
  std::vector<AxisCamera> cameras;
  double first = 0, last = 0;
  result.finest_step = std::numeric_limits<double>::infinity();
  for (const Rig::Camera& camera : rig.cameras) {
    const schemas::Intrinsics& k = camera.model.intrinsics();
    const int pixels = is_horizontal ? camera.model.width() : camera.model.height();
    const double focal = is_horizontal ? k.fx : k.fy;
    const double centre = is_horizontal ? k.cx : pixels - k.cy;  // y up
    const Eigen::Vector3d axis_of_camera = camera.pose.viewing_direction();
    AxisCamera one;
    one.position = along.dot(camera.pose.position - rig.centre());
    one.rotation = std::atan2(along.dot(axis_of_camera), ahead.dot(axis_of_camera));
    one.pitch = 1 / focal;
    one.least = -centre / focal;
    one.largest = (pixels - centre) / focal;
    cameras.push_back(one);
    first = std::min(first, one.position);
    last = std::max(last, one.position);
    result.pixels = std::max(result.pixels, pixels);
    result.max_rotation = std::max(result.max_rotation, std::abs(one.rotation));
    const auto count = static_cast<double>(rig.cameras.size());
    result.row.pixel_pitch += one.pitch / count;
    result.row.fov += (std::atan(one.largest) - std::atan(one.least)) / count;
    for (const double slope : {one.least, one.largest - one.pitch, -one.pitch / 2}) {
      const double step = ray_slope(one, slope + one.pitch) - ray_slope(one, slope);
      result.finest_step = std::min(result.finest_step, step);
      result.coarsest_step = std::max(result.coarsest_step, step);
    }
  }
  result.width = last - first;
  constexpr double kParallel = 1e-6;  // radians
  if (result.max_rotation < kParallel) {
    if (const auto distance = fixed_focal_distance(cameras)) {
      result.row.fixed_focal_distance = *distance;
      result.is_skewed = std::isfinite(*distance);
    }
  }
  return result;
}

}  // namespace raystage::rig
