// SPDX-License-Identifier: Apache-2.0
// Projection and unprojection of a camera: a pinhole with Brown-Conrady distortion
// (brown_conrady.h) or a fisheye (fisheye_lens.h). Inputs: points in the camera (metres) or pixels;
// outputs: pixels or rays.
#include "rig/camera_model.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/error.h"
#include "rig/brown_conrady.h"

namespace raystage::rig {
namespace {

// Tolerance of the inverse, with a margin to the documented 1e-9 px.
constexpr double kInversePixels = 2e-10;
// Least cosine to the axis of a ray with an ideal image point.
constexpr double kLeastForward = 1e-8;
// Least radius of a picture, pixels.
constexpr double kLeastRadius = 0.5;

/// Returns whether a facet shows a direction in its axes (x right, y down, z ahead).
bool shows(const Facet& facet, const Eigen::Vector3d& direction) {
  const double z = direction.z();
  return z > 0 && direction.x() >= facet.left * z && direction.x() <= facet.right * z &&
         direction.y() >= facet.top * z && direction.y() <= facet.bottom * z;
}

}  // namespace

CameraModel::CameraModel(const schemas::CameraGeometry& geometry)
    : intrinsics_(geometry.intrinsics), width_(geometry.width), height_(geometry.height) {
  const schemas::Distortion& d = intrinsics_.distortion;
  const std::array<double, 4>& r = intrinsics_.radial_distortion;
  const std::array<double, 14> numbers{intrinsics_.fx, intrinsics_.fy,
                                       intrinsics_.cx, intrinsics_.cy,
                                       d.k1,           d.k2,
                                       d.p1,           d.p2,
                                       d.k3,           r[0],
                                       r[1],           r[2],
                                       r[3],           intrinsics_.half_angle.value_or(1)};
  const std::string where = "camera " + geometry.id;
  if (!std::ranges::all_of(numbers, [](double number) { return std::isfinite(number); }) ||
      !std::ranges::all_of(geometry.world_from_camera,
                           [](double number) { return std::isfinite(number); })) {
    throw Error::bad_input("the calibration contains a number that is not finite", where,
                           "Give finite intrinsics, distortion and pose");
  }
  if (!(intrinsics_.fx > 0 && intrinsics_.fy > 0)) {
    throw Error::bad_input("the focal length is not positive", where,
                           "Give fx and fy in pixels, above 0");
  }
  if (width_ <= 0 || height_ <= 0) {
    throw Error::bad_input("the image size is not positive", where,
                           "Give width and height in pixels, above 0");
  }
  if (intrinsics_.projection != schemas::Projection::kPinhole) {
    fisheye_ = std::make_shared<const FisheyeLens>(intrinsics_);
    const double largest = fisheye_->largest_angle();
    if (!(largest > 0 &&
          fisheye_->distance(largest) * std::max(intrinsics_.fx, intrinsics_.fy) > kLeastRadius)) {
      throw Error::bad_input("the fisheye lens sees nothing", where,
                             "Check the radial distortion and the half angle (radians)");
    }
    return;
  }
  const double radius = fold_radius(d);
  // A fold within half a pixel of the principal point leaves no usable picture.
  if (!(radius * std::max(intrinsics_.fx, intrinsics_.fy) > kLeastRadius)) {
    throw Error::bad_input("the lens distortion folds back at the principal point", where,
                           "Check the distortion coefficients and their order k1, k2, p1, p2, k3");
  }
  fold_radius_squared_ = radius * radius;
}

std::optional<Eigen::Vector2d> CameraModel::project(const Eigen::Vector3d& x_in_camera) const {
  if (fisheye_) return pixel_of_direction({x_in_camera.x(), -x_in_camera.y(), -x_in_camera.z()});
  if (!(x_in_camera.z() < 0)) return std::nullopt;
  return pixel_from_ideal(
      {x_in_camera.x() / -x_in_camera.z(), -x_in_camera.y() / -x_in_camera.z()});
}

std::optional<Eigen::Vector3d> CameraModel::unproject(const Eigen::Vector2d& pixel) const {
  if (fisheye_) {
    const auto direction = direction_of_pixel(pixel);
    if (!direction) return std::nullopt;
    return Eigen::Vector3d(direction->x(), -direction->y(), -direction->z());
  }
  const auto ideal = ideal_from_pixel(pixel);
  if (!ideal) return std::nullopt;
  return Eigen::Vector3d(ideal->x(), -ideal->y(), -1);
}

std::optional<Eigen::Vector2d> CameraModel::pixel_from_ideal(const Eigen::Vector2d& ideal) const {
  if (fisheye_) return pixel_of_direction(ideal.homogeneous());
  // The margin lets results of ideal_from_pixel() at the fold project again.
  if (!ideal.allFinite() || !(ideal.squaredNorm() <= fold_radius_squared_ * (1 + 1e-14))) {
    return std::nullopt;
  }
  const Eigen::Vector2d distorted =
      has_distortion() ? distort(intrinsics_.distortion, ideal) : ideal;
  return pixel_from_image(distorted);
}

std::optional<Eigen::Vector2d> CameraModel::pixel_from_image(
    const std::optional<Eigen::Vector2d>& point) const {
  if (!point) return std::nullopt;
  return Eigen::Vector2d(intrinsics_.fx * point->x() + intrinsics_.cx,
                         intrinsics_.fy * point->y() + intrinsics_.cy);
}

Eigen::Vector2d CameraModel::image_from_pixel(const Eigen::Vector2d& pixel) const {
  return {(pixel.x() - intrinsics_.cx) / intrinsics_.fx,
          (pixel.y() - intrinsics_.cy) / intrinsics_.fy};
}

std::optional<Eigen::Vector2d> CameraModel::ideal_from_pixel(const Eigen::Vector2d& pixel) const {
  if (!pixel.allFinite()) return std::nullopt;
  const Eigen::Vector2d distorted = image_from_pixel(pixel);
  if (fisheye_) {
    const auto direction = direction_of_pixel(pixel);
    if (!direction || !(direction->z() > kLeastForward)) return std::nullopt;
    return Eigen::Vector2d(direction->hnormalized());
  }
  if (!has_distortion()) return distorted;
  const double tolerance = kInversePixels / std::max(intrinsics_.fx, intrinsics_.fy);
  return undistort(intrinsics_.distortion, distorted, std::sqrt(fold_radius_squared_), tolerance);
}

CameraModel CameraModel::with_facet(const Facet& facet) const {
  if (!fisheye_) throw std::logic_error("a pinhole has no facets");
  CameraModel model = *this;
  model.facet_ = std::make_shared<const Facet>(facet);
  return model;
}

double CameraModel::facet_share(const Eigen::Vector3d& x_in_camera) const {
  if (!facet_) return 1;
  if (!(x_in_camera.z() < 0)) return 0;
  const double farthest = x_in_camera.head<2>().cwiseAbs().maxCoeff() / -x_in_camera.z();
  return std::clamp((Facet::kReach - farthest) / (Facet::kReach - 1), 0.0, 1.0);
}

std::optional<Eigen::Vector2d> CameraModel::pixel_of_direction(
    const Eigen::Vector3d& direction) const {
  if (!facet_) return pixel_from_image(fisheye_->image_from_direction(direction));
  if (!shows(*facet_, direction)) return std::nullopt;
  return pixel_from_image(fisheye_->image_from_direction(facet_->lens_from_facet * direction));
}

std::optional<Eigen::Vector3d> CameraModel::direction_of_pixel(const Eigen::Vector2d& pixel) const {
  const auto direction = fisheye_->direction_from_image(image_from_pixel(pixel));
  if (!direction || !facet_) return direction;
  const Eigen::Vector3d of_facet = facet_->lens_from_facet.transpose() * *direction;
  if (!shows(*facet_, of_facet)) return std::nullopt;
  return of_facet;
}

bool CameraModel::contains(const Eigen::Vector2d& pixel) const {
  return pixel.x() >= 0 && pixel.x() <= width_ && pixel.y() >= 0 && pixel.y() <= height_;
}

}  // namespace raystage::rig
