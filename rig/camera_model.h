// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "schemas/geometry.h"

namespace raystage {

/// A pinhole camera with Brown-Conrady distortion (thesis 4.3; OpenCV's coefficients).
///
/// Three spaces: x_in_camera (metres, looks down -z), `ideal` image points (x/-z, -y/-z: y down, no
/// distortion) and pixels (origin at the top-left corner, y down, pixel centres at +0.5).
///
/// The distortion polynomial folds back where it stops growing with the radius. Beyond that radius
/// a pixel would stand for two rays: the model ends there, and such points have no projection.
class CameraModel {
 public:
  /// Throws Error (bad input) for non-finite values, a focal length or a size that is not positive,
  /// or a distortion that folds back at the principal point itself. `id` names the camera in
  /// errors.
  explicit CameraModel(const CameraGeometry& geometry);

  int width() const { return width_; }
  int height() const { return height_; }
  const Intrinsics& intrinsics() const { return intrinsics_; }

  /// Pixel of a point, nullopt at or behind the camera's own plane (z >= 0) or beyond the fold.
  /// The pixel may lie outside the image.
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& x_in_camera) const;
  /// Ray through a pixel, scaled to z = -1; nullopt where no ray reaches the pixel.
  /// project(unproject(p)) == p to 1e-9 px wherever it answers.
  std::optional<Eigen::Vector3d> unproject(const Eigen::Vector2d& pixel) const;

  /// Pixel of an ideal image point, or nullopt beyond the fold.
  std::optional<Eigen::Vector2d> pixel_from_ideal(const Eigen::Vector2d& ideal) const;
  /// Ideal image point of a pixel, or nullopt where the pixel is beyond the fold.
  std::optional<Eigen::Vector2d> ideal_from_pixel(const Eigen::Vector2d& pixel) const;

  /// Square of the largest ideal radius before the distortion folds back; infinity if it never
  /// does.
  double fold_radius_squared() const { return fold_radius_squared_; }
  bool has_distortion() const { return !(intrinsics_.distortion == Distortion{}); }
  /// Whether a pixel position lies within the image, [0, width] x [0, height].
  bool contains(const Eigen::Vector2d& pixel) const;

 private:
  Intrinsics intrinsics_;
  int width_ = 0, height_ = 0;
  double fold_radius_squared_ = 0;
};

}  // namespace raystage
