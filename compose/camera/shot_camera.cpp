// SPDX-License-Identifier: Apache-2.0
// Evaluates the virtual camera of a shot at a fractional frame. Keys, or a .chan or glTF file, give
// position, orientation or target, roll and focal length. The orbit then rotates the pose about its
// axis. The dolly zoom (thesis eq. 7.1) keeps the size of its target: the focal length is
// proportional to the target's depth. Input: keys in world coordinates, metres; focal lengths in
// half image widths. Output: the state, or a camera in pixels. Cost: O(log n) per frame for n keys.
#include "compose/camera/shot_camera.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "base/error.h"
#include "compose/camera/camera_file.h"

namespace raystage::compose {
namespace {

using Eigen::Vector3d;

}  // namespace

ShotCamera::ShotCamera(const schemas::ShotDocument& shot, const std::filesystem::path& shot_file,
                       const std::filesystem::path& folder)
    : is_equirectangular_(shot.camera.projection ==
                          schemas::ShotDocument::Camera::Projection::kEquirectangular),
      width_(shot.width),
      height_(shot.height),
      film_back_mm_(shot.camera.film_back_mm),
      where_(shot_file.string() + "#/camera"),
      channels_(channels_from_keys(shot.camera, where_)),
      orbit_(shot.camera.orbit),
      dolly_zoom_(shot.camera.dolly_zoom) {
  if (const auto& source = shot.camera.file) {
    const std::filesystem::path base = folder.empty() ? shot_file.parent_path() : folder;
    const std::filesystem::path file = (base / source->path).lexically_normal();
    files_.push_back(file);
    ImportedCamera imported = import_camera(shot, file, where_);
    file_summary_ = imported.summary;
    if (!imported.focal_is_animated && channels_.focal) {
      // glTF requires a lens, and programs write that of one frame where it is animated.
      imported.channels.focal = nullptr;
      file_summary_ += ", lens of the keys";
    }
    channels_ = merge_channels(std::move(imported.channels), channels_, where_);
  }
  const auto refuse = [&](const char* what, const char* what_to_do) {
    throw Error::bad_input(what, where_, what_to_do);
  };
  if (!channels_.position) refuse("the camera has no position", "Add position to a key");
  if (is_equirectangular_) {
    constexpr double kAnyFocal = 1;  // it has no effect, but states have one
    channels_.focal = [](double) { return kAnyFocal; };
  }
  if (!channels_.focal) {
    refuse("the camera has no focal length", "Add horizontal_fov_deg or focal_length_mm to a key");
  }
  if (channels_.orientation && channels_.target) {
    refuse("the camera has both orientations and targets", "Use one of them in all keys");
  }
  if (static_cast<bool>(channels_.orbit) != orbit_.has_value()) {
    refuse("an orbit needs both the member \"orbit\" and keys with orbit_deg; one is missing",
           "Add the missing one, or remove both");
  }
  if (shot.camera.stereo) {
    stereo_ = StereoSettings{shot.camera.stereo->interaxial_m, shot.camera.stereo->convergence_m};
  }
  if (dolly_zoom_) {
    const double frame = dolly_zoom_->frame.value_or(shot.first_frame);
    const rig::Pose pose = animated_pose(frame);
    const double depth = -pose.camera_from_world(Vector3d(dolly_zoom_->target.data())).z();
    if (!(depth > 0)) {
      refuse("the target of dolly_zoom is behind the camera at the frame that sets its size",
             "Move the target, or choose another frame");
    }
    dolly_focal_per_metre_ = channels_.focal(frame) / depth;
  }
}

rig::Pose ShotCamera::animated_pose(double frame) const {
  rig::Pose pose;
  pose.position = channels_.position(frame);
  if (channels_.target) {
    const Vector3d target = channels_.target(frame);
    if ((target - pose.position).norm() == 0) {
      throw Error::bad_input(fmt::format("at frame {} the camera is at its target", frame), where_,
                             "Move the target or the camera");
    }
    pose.world_from_camera_rotation = look_at_rotation(pose.position, target);
  } else if (channels_.orientation) {
    pose.world_from_camera_rotation = channels_.orientation(frame).toRotationMatrix();
  }
  if (channels_.roll) {
    pose.world_from_camera_rotation *=
        Eigen::AngleAxisd(-channels_.roll(frame), Vector3d::UnitZ()).toRotationMatrix();
  }
  if (orbit_) {
    const Vector3d centre(orbit_->center.data());
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(channels_.orbit(frame), Vector3d(orbit_->axis.data()).normalized())
            .toRotationMatrix();
    pose.position = centre + turn * (pose.position - centre);
    pose.world_from_camera_rotation = turn * pose.world_from_camera_rotation;
  }
  return pose;
}

double ShotCamera::focal_at(double frame, const rig::Pose& pose) const {
  if (!dolly_zoom_) return channels_.focal(frame);
  // Thesis eq. 7.1: tan(fov / 2) is proportional to the inverse distance of the target.
  return dolly_focal_per_metre_ * -pose.camera_from_world(Vector3d(dolly_zoom_->target.data())).z();
}

CameraState ShotCamera::state(double frame) const {
  CameraState state;
  state.pose = animated_pose(frame);
  state.film_back_mm = film_back_mm_;
  state.focal_length_mm = focal_at(frame, state.pose) * film_back_mm_ / 2;
  if (channels_.shift_x) state.shift_x = channels_.shift_x(frame);
  if (channels_.shift_y) state.shift_y = channels_.shift_y(frame);
  if (channels_.focus) state.focus_m = channels_.focus(frame);
  if (channels_.f_number) state.f_number = channels_.f_number(frame);
  if (channels_.shutter) state.shutter_deg = channels_.shutter(frame);
  if (!state.pose.position.allFinite() || !state.pose.world_from_camera_rotation.allFinite()) {
    throw Error::bad_input(fmt::format("at frame {} the camera's pose is not finite", frame),
                           where_, "Check its keys for numbers that are too large");
  }
  if (!(std::isfinite(state.focal_length_mm) && state.focal_length_mm > 0)) {
    throw Error::bad_input(
        dolly_zoom_
            ? fmt::format("at frame {} the target of dolly_zoom is not in front of the camera",
                          frame)
            : fmt::format("at frame {} the focal length is {} mm, allowed: above 0", frame,
                          state.focal_length_mm),
        where_, dolly_zoom_ ? "Keep the target in front of the camera" : "Correct the lens");
  }
  return state;
}

render::VirtualCamera ShotCamera::camera(double frame, Eye eye) const {
  return camera(state(frame), eye);
}

render::VirtualCamera ShotCamera::camera(const CameraState& state, Eye eye) const {
  if (is_equirectangular_) {
    const double half = stereo_ ? stereo_->interaxial_m / 2 : 0;
    const double offset = eye == Eye::kLeft ? -half : eye == Eye::kRight ? half : 0;
    return render::equirectangular_camera(width_, height_, state.pose, offset);
  }
  return make_virtual_camera(stereo_ ? stereo_eye_state(state, *stereo_, eye) : state, width_,
                             height_);
}

std::vector<Eye> ShotCamera::eyes() const {
  return is_stereo() ? std::vector{Eye::kLeft, Eye::kRight} : std::vector{Eye::kBoth};
}

}  // namespace raystage::compose
