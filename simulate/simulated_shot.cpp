// SPDX-License-Identifier: Apache-2.0
// Makes a smooth camera move whose views stay within the range of motion of the array (thesis 5.2),
// and the ground-truth views along it. Positions in metres, angles in degrees.
#include "simulate/simulated_shot.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "base/frame_rate.h"
#include "rig/pose.h"
#include "rig/rig.h"
#include "simulate/simulated_rig.h"
#include "store/timeline.h"

namespace raystage::simulate {
namespace {

constexpr double kDegrees = std::numbers::pi / 180;
constexpr int kMinKeys = 8;
constexpr int kTimesOfExposure = 32;

/// The half width and height of the array, metres, along its x and y axes.
struct Extent {
  double half_x = 0, half_y = 0;
  double turn = 0;  ///< of the path about the array, radians to each side; pi: all around
};
Extent extent_of(const SimulationOptions& s) {
  if (!s.given_rig) return {s.spacing * (s.columns - 1) / 2, s.spacing * (s.rows - 1) / 2, 0};
  const rig::Rig array = rig::rig_from_document(*s.given_rig);
  Eigen::Vector3d low = array.cameras[0].pose.position, high = low;
  for (const rig::Rig::Camera& camera : array.cameras) {
    low = low.cwiseMin(camera.pose.position);
    high = high.cwiseMax(camera.pose.position);
  }
  // Within an array that looks around, a half is near its cameras' rays in all directions.
  const double part = array.looks_around() ? 0.35 : 0.5;
  const Eigen::Vector3d half = part * (high - low);
  // Cameras on a hemisphere record nothing behind it.
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const rig::Rig::Camera& camera : array.cameras) sum += camera.pose.viewing_direction();
  const bool looks_ahead = sum.norm() > 0.3 * static_cast<double>(array.cameras.size());
  const double turn = looks_ahead ? 40 * kDegrees : std::numbers::pi;
  return {half.x(), half.y(), array.looks_around() ? turn : 0};
}

// Returns the camera key at `u`, from 0 at the first frame to 1 at the last.
schemas::ShotDocument::CameraKey key_at(const SimulationOptions& s, double frame, double u) {
  constexpr double kTurn = 2 * std::numbers::pi;
  // Narrower than the cameras, so that the view stays within their common field of view.
  const double widest = std::min(s.horizontal_fov_deg, 120.0);
  const double fov = widest * (0.71 + 0.05 * std::cos(kTurn * u));
  const auto [half_x, half_y, turn] = extent_of(s);
  // Moves along the axis as far as the corner rays still pass between the outer cameras.
  const double slope = std::tan(fov / 2 * kDegrees);
  const double depth = 0.35 * std::min(half_x, half_y * s.view_width() / s.view_height()) / slope;
  // An array that looks around is shown all around, or as far as its cameras look.
  const double small = 0.03 * widest * std::sin(kTurn * u) * kDegrees;
  const double yaw = turn == 0                  ? small
                     : turn >= std::numbers::pi ? kTurn * u
                                                : turn * std::sin(kTurn * u);
  const double pitch = 0.015 * widest * std::sin(kTurn * u + 1) * kDegrees;
  const rig::Pose of_array = simulated_rig_pose(s);
  const Eigen::Quaterniond orientation(Eigen::Quaterniond(of_array.world_from_camera_rotation) *
                                       Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()) *
                                       Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitX()));
  schemas::ShotDocument::CameraKey key;
  key.frame = frame;
  const Eigen::Vector3d place = of_array.world_from_camera(Eigen::Vector3d(
      0.5 * half_x * std::sin(kTurn * (0.9 * u - 0.2)),
      0.4 * half_y * std::sin(kTurn * (0.6 * u + 0.1)), depth * std::cos(kTurn * 0.7 * u)));
  key.position = {{place.x(), place.y(), place.z()}};
  key.orientation = {{orientation.w(), orientation.x(), orientation.y(), orientation.z()}};
  key.horizontal_fov_deg = fov;
  return key;
}

schemas::ViewsDocument::View view_of(const SimulationOptions& s,
                                     const schemas::ShotDocument::CameraKey& key, int number,
                                     Nanoseconds time) {
  schemas::ViewsDocument::View view;
  view.geometry.id = fmt::format("view{:03}", number);
  view.geometry.width = s.view_width();
  view.geometry.height = s.view_height();
  const double focal = s.view_width() / 2.0 / std::tan(*key.horizontal_fov_deg / 2 * kDegrees);
  view.geometry.intrinsics = {focal, focal, s.view_width() / 2.0, s.view_height() / 2.0, {}};
  rig::Pose pose;
  const auto& q = *key.orientation;
  pose.world_from_camera_rotation =
      Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
  const auto& position = *key.position;
  pose.position = {position[0], position[1], position[2]};
  view.geometry.world_from_camera = rig::matrix_from_pose(pose);
  view.file = "truth/" + view.geometry.id + ".png";
  view.depth_file = "truth/" + view.geometry.id + ".depth.exr";
  if (s.hdr) view.light_file = "truth/" + view.geometry.id + ".light.exr";
  view.time_ns = time;
  return view;
}

struct Span {
  Nanoseconds first_tick = 0;
  double seconds = 0;
};

// Returns the first tick and the duration of the take's timeline.
Span usable_span(const SimulationOptions& s, const ExposureSchedule& schedule) {
  std::vector<std::vector<Nanoseconds>> times;
  bool any = false;
  for (const ExposureSchedule::Camera& camera : schedule.cameras) {
    auto& column = times.emplace_back();
    for (const ExposureSchedule::Frame& frame : camera.frames) {
      if (frame.status == store::FrameStatus::kStored) column.push_back(frame.stamped_time);
    }
    any = any || !column.empty();
  }
  if (!any) return {};
  const store::Timeline timeline = store::build_timeline(times, s.fps, 0, 0, "simulated take");
  const Nanoseconds first = timeline.ticks.front().time_ns;
  return {first, static_cast<double>(timeline.ticks.back().time_ns - first) * 1e-9};
}

}  // namespace

SimulatedShot make_simulated_shot(const SimulationOptions& s, const ExposureSchedule& schedule,
                                  double focus) {
  SimulatedShot path;
  schemas::ShotDocument& shot = path.shot;
  shot.name = "virtual path through " + s.scene;
  shot.width = s.view_width();
  shot.height = s.view_height();
  const FrameRate rate = frame_rate_from(std::round(s.fps * 1000) / 1000).value_or(FrameRate{});
  shot.fps = rate.fps();
  shot.fps_numerator = rate.numerator;
  shot.fps_denominator = rate.denominator;
  shot.first_frame = 1;
  shot.last_frame = s.shot_frames;
  const int steps = s.shot_frames - 1;

  // Centred in the take, at normal speed if the take is long enough, otherwise slowed down.
  const Span usable = usable_span(s, schedule);
  const double duration = steps / rate.fps();
  schemas::ShotDocument::Layer layer;
  layer.name = "take";
  layer.take = ".";
  layer.focal_plane.kind = schemas::ShotDocument::FocalPlane::Kind::kDepth;
  layer.focal_plane.depth = focus;
  layer.speed = duration > usable.seconds ? usable.seconds / duration : 1;
  const double unused = std::max(0.0, usable.seconds - duration * layer.speed);
  layer.start_seconds = std::floor(unused / 2 * 1000) / 1000;
  shot.layers.push_back(layer);

  const auto frame_of = [&](int index, int count) {
    if (count < 2) return shot.first_frame + steps / 2;
    return shot.first_frame +
           static_cast<int>(std::lround(static_cast<double>(index) * steps / (count - 1)));
  };
  const auto key_of = [&](double frame) {
    return key_at(s, frame, steps > 0 ? static_cast<double>(frame - shot.first_frame) / steps : 0);
  };
  const double shutter = s.truth_shutter_deg / 360;  // frames
  std::set<double> key_frames;
  for (int i = 0; i < kMinKeys; ++i) key_frames.insert(frame_of(i, kMinKeys));
  path.views.color_space = "srgb_texture";
  for (int i = 0; i < s.truth_views; ++i) {
    const int frame = frame_of(i, s.truth_views);
    const auto view_at = [&](double time) {
      const double since_first_tick =
          layer.start_seconds + (time - shot.first_frame) / rate.fps() * layer.speed;
      return view_of(s, key_of(time), i,
                     usable.first_tick + static_cast<Nanoseconds>(std::llround(
                                             since_first_tick * kNanosecondsPerSecond)));
    };
    path.views.views.push_back(view_at(frame));
    auto& exposure = path.exposures.emplace_back();
    const int times = shutter > 0 ? kTimesOfExposure : 1;
    for (int t = 0; t < times; ++t) {
      exposure.push_back(view_at(frame + shutter * ((t + 0.5) / times - 0.5)));
    }
    // The shot's camera follows the same path while the shutter is open.
    for (const double offset : {-shutter / 2, 0.0, shutter / 2}) key_frames.insert(frame + offset);
  }
  for (const double frame : key_frames) shot.camera.keys.push_back(key_of(frame));
  if (shutter > 0) {
    shot.camera.keys.front().shutter_deg = s.truth_shutter_deg;
    shot.layers.front().time = schemas::ShotDocument::Layer::Time::kExact;
  }
  return path;
}

}  // namespace raystage::simulate
