// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "compose/camera/camera_channels.h"
#include "compose/camera/camera_state.h"
#include "schemas/shot_document.h"

namespace raystage {

/// The virtual camera of a shot, at any fractional frame: its keys or its file, then its orbit,
/// then its dolly_zoom. Before the first and after the last key it rests.
class ShotCamera {
 public:
  /// `shot_file`: what errors name. `folder`: what paths are relative to; empty: the shot file's.
  /// Reads the camera's file, if there is one. Throws Error (bad input) for keys that cannot be
  /// used, and where the shot says no position or no lens.
  ShotCamera(const ShotDocument& shot, const std::filesystem::path& shot_file,
             const std::filesystem::path& folder = {});

  /// Throws Error (bad input) where the camera is nowhere, looks nowhere (at a target where it
  /// stands itself), or its lens would have a focal length of 0 or less.
  CameraState state(double frame) const;

  /// One eye's camera at a frame of the shot's size; kBoth in a shot that is not stereo.
  VirtualCamera camera(double frame, Eye eye = Eye::kBoth) const;

  bool is_stereo() const { return stereo_.has_value(); }
  /// kLeft and kRight, or kBoth alone.
  std::vector<Eye> eyes() const;

  /// Files that the camera comes from: none or one.
  const std::vector<std::filesystem::path>& files() const { return files_; }

 private:
  Pose animated_pose(double frame) const;
  double focal_at(double frame, const Pose& pose) const;

  int width_, height_;
  double film_back_mm_;
  std::string where_;
  CameraChannels channels_;
  std::optional<ShotDocument::Orbit> orbit_;
  std::optional<ShotDocument::DollyZoom> vertigo_;
  double vertigo_focal_per_metre_ = 0;
  std::optional<StereoSettings> stereo_;
  std::vector<std::filesystem::path> files_;
};

}  // namespace raystage
