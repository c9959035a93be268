// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <limits>
#include <memory>
#include <optional>

#include "rig/fisheye_lens.h"
#include "schemas/geometry.h"

namespace raystage::rig {

/// A part of a fisheye's rays, as a pinhole with other axes shows them: those whose ideal image
/// points, in the facet's axes, are within a rectangle. The frame stays that of the fisheye.
struct Facet {
  /// Rotation, between axes x right, y down, z ahead.
  Eigen::Matrix3d lens_from_facet = Eigen::Matrix3d::Identity();
  double left = 0, right = 0, top = 0, bottom = 0;  ///< ideal image points
  double focal_length = 1;                          ///< of the pinhole, pixels
  /// Facets of a camera overlap beyond |x| = 1 and |y| = 1, up to this.
  static constexpr double kReach = 1.2;
};

/// A camera: a pinhole with Brown-Conrady distortion (thesis 4.3; OpenCV's coefficients), or a
/// fisheye (FisheyeLens).
///
/// Three spaces: x_in_camera (metres, looks down -z), `ideal` image points (x/-z, -y/-z: y down, no
/// distortion) and pixels (origin at the top-left corner, y down, pixel centres at +0.5).
///
/// The distortion polynomial folds back where it stops increasing with the radius. Beyond that
/// radius two rays would map to one pixel. The model ends there: such points have no projection.
/// Ideal image points are those of rays in front of the camera's plane: a fisheye has rays without
/// one, at or behind it.
class CameraModel {
 public:
  /// Throws Error (bad input), with the camera's id, for non-finite values or a focal length or
  /// size that is not positive. Also throws for a distortion that folds back at the principal point
  /// itself, and for a fisheye that sees nothing.
  explicit CameraModel(const schemas::CameraGeometry& geometry);

  int width() const { return width_; }
  int height() const { return height_; }
  const schemas::Intrinsics& intrinsics() const { return intrinsics_; }

  /// Returns the fisheye lens, or null for a pinhole.
  const FisheyeLens* fisheye() const { return fisheye_.get(); }

  /// Returns a facet of this fisheye. Its camera axes and ideal image points are the facet's; rays
  /// outside the facet do not exist.
  CameraModel with_facet(const Facet& facet) const;
  /// Returns the facet, or null for a whole camera.
  const Facet* facet() const { return facet_.get(); }
  /// Returns the share of a facet in a point that it and its neighbours show: 1, but falls to 0
  /// where facets overlap. 1 for a whole camera.
  double facet_share(const Eigen::Vector3d& x_in_camera) const;

  /// Returns the pixel of a point, or nullopt at or behind a pinhole's plane (z >= 0), or beyond
  /// the fold or a fisheye's largest angle. The pixel may lie outside the image.
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& x_in_camera) const;
  /// Returns the ray through a pixel, scaled to z = -1 for a pinhole and to length 1 for a fisheye,
  /// or nullopt if no ray reaches the pixel. Wherever there is a ray, project(unproject(p)) equals
  /// p to 1e-9 px.
  std::optional<Eigen::Vector3d> unproject(const Eigen::Vector2d& pixel) const;

  /// Returns the pixel of an ideal image point, or nullopt beyond the fold.
  std::optional<Eigen::Vector2d> pixel_from_ideal(const Eigen::Vector2d& ideal) const;
  /// Returns the ideal image point of a pixel, or nullopt if the pixel is beyond the fold, or its
  /// ray does not point ahead.
  std::optional<Eigen::Vector2d> ideal_from_pixel(const Eigen::Vector2d& pixel) const;

  /// Returns the squared ideal radius at which a pinhole's distortion folds back, or infinity.
  double fold_radius_squared() const { return fold_radius_squared_; }
  /// Returns whether ideal image points are not those of a pinhole without distortion.
  bool has_distortion() const {
    return fisheye_ != nullptr || !(intrinsics_.distortion == schemas::Distortion{});
  }
  /// Returns whether a pixel position is within the image, [0, width] x [0, height].
  bool contains(const Eigen::Vector2d& pixel) const;

 private:
  /// Image points are in focal lengths from the principal point, after the distortion.
  std::optional<Eigen::Vector2d> pixel_from_image(
      const std::optional<Eigen::Vector2d>& point) const;
  Eigen::Vector2d image_from_pixel(const Eigen::Vector2d& pixel) const;

  /// Directions have the axes x right, y down, z ahead.
  std::optional<Eigen::Vector2d> pixel_of_direction(const Eigen::Vector3d& direction) const;
  std::optional<Eigen::Vector3d> direction_of_pixel(const Eigen::Vector2d& pixel) const;

  schemas::Intrinsics intrinsics_;
  int width_ = 0, height_ = 0;
  double fold_radius_squared_ = std::numeric_limits<double>::infinity();
  std::shared_ptr<const FisheyeLens> fisheye_;
  std::shared_ptr<const Facet> facet_;
};

}  // namespace raystage::rig
