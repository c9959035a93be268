// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "render/common/view.h"
#include "replay/source_pictures.h"

namespace raystage::replay {

/// An epipolar-plane image (Bolles, Baker and Marimont, 1987): one row of pixels of each camera of
/// a row of the array, one below the other. Points of the scene are lines; the nearer, the more
/// slanted.
struct EpipolarImage {
  store::RgbImage picture;
  std::vector<std::string> camera_ids;  ///< from the top
  /// Where the rays of the virtual camera's row cross the array: column and row of the picture, for
  /// pixels of the view from left to right. A ray that no camera of the row would see is left out.
  std::vector<std::array<double, 2>> view_line;
  /// Where each camera sees the point in focus under the pixel, columns; none outside of its frame.
  std::vector<std::optional<double>> focus_columns;
};

/// Returns the cameras of a row of the array: those with the rig's row number whose height, along
/// the view's up axis, is nearest to the virtual camera; without row numbers, those within half a
/// camera spacing of that height. From left to right as the view sees them.
std::vector<int> camera_row_near(const rig::Rig& rig, const render::VirtualCamera& view);

/// Returns the epipolar-plane image for a pixel of a view. The row of each camera is the one in
/// which it sees the pixel's point at `focus_m` along the optical axis. `size`: of the picture.
/// Throws Error (bad input) if no camera of the row has a frame, or epipolar lines are not rows of
/// pixels: with fisheyes, and cameras that look around.
EpipolarImage make_epipolar_image(const SourceFrames& source, const render::VirtualCamera& view,
                                  const Eigen::Vector2d& pixel, double focus_m, PictureSize size);

}  // namespace raystage::replay
