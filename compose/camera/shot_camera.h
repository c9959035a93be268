// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "compose/camera/camera_channels.h"
#include "compose/camera/camera_state.h"
#include "schemas/shot_document.h"

namespace raystage::compose {

/// The virtual camera of a shot at any fractional frame: its keys or its file, then its orbit, then
/// its dolly zoom. Constant before the first and after the last key.
class ShotCamera {
 public:
  /// Reads the camera's file, if any. `shot_file`: named by errors. `folder`: what paths are
  /// relative to; empty: that of the shot file. Throws Error (bad input) for invalid keys, or if
  /// the shot gives no position or no focal length.
  ShotCamera(const schemas::ShotDocument& shot, const std::filesystem::path& shot_file,
             const std::filesystem::path& folder = {});

  /// Throws Error (bad input) if the pose is not finite, the target is at the camera's position, or
  /// the focal length is not above 0.
  CameraState state(double frame) const;

  /// Returns the camera of one eye for views of the shot's size. kBoth: of a shot without stereo.
  render::VirtualCamera camera(double frame, Eye eye = Eye::kBoth) const;
  /// Returns the same for a state that is not on the camera's path.
  render::VirtualCamera camera(const CameraState& state, Eye eye) const;

  bool is_stereo() const { return stereo_.has_value(); }
  /// Returns whether its views show all directions; their eyes are those of omnidirectional stereo.
  bool is_equirectangular() const { return is_equirectangular_; }
  /// Returns kLeft and kRight, or kBoth only.
  std::vector<Eye> eyes() const;

  /// Returns the files that the camera was read from: none or one.
  const std::vector<std::filesystem::path>& files() const { return files_; }
  /// Returns what was read from the camera's file (ImportedCamera::summary); "" without a file.
  const std::string& file_summary() const { return file_summary_; }

 private:
  rig::Pose animated_pose(double frame) const;
  double focal_at(double frame, const rig::Pose& pose) const;

  bool is_equirectangular_;
  int width_, height_;
  double film_back_mm_;
  std::string where_;
  CameraChannels channels_;
  std::optional<schemas::ShotDocument::Orbit> orbit_;
  std::optional<schemas::ShotDocument::DollyZoom> dolly_zoom_;
  double dolly_focal_per_metre_ = 0;
  std::optional<StereoSettings> stereo_;
  std::vector<std::filesystem::path> files_;
  std::string file_summary_;
};

}  // namespace raystage::compose
