// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <boost/container/small_vector.hpp>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "planning/ideal_view.h"
#include "render/common/plane_projection.h"
#include "rig/fisheye_lens.h"
#include "rig/rig.h"

namespace raystage::planning {

inline constexpr int kBorders = 4;  // left, right, top, bottom
/// How far inside its picture's borders a camera sees a point; below 0: outside.
using Borders = std::array<double, kBorders>;
inline constexpr Borders kNowhere{-1, -1, -1, -1};

/// A sphere in focus, as that of equirectangular views of arrays that look around.
struct FocalSphere {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< world, metres
  double radius = 0;                                 ///< metres
  Eigen::Vector3d eye = Eigen::Vector3d::Zero();     ///< of the view
  /// The world direction (not unit) of a homogeneous pixel of the view.
  Eigen::Matrix3d ray_from_pixel = Eigen::Matrix3d::Identity();

  /// Returns where the ray through a homogeneous pixel leaves the sphere, or nullopt where it does
  /// not meet it.
  std::optional<Eigen::Vector3d> point_at(const Eigen::Vector3d& pixel) const {
    const Eigen::Vector3d direction = (ray_from_pixel * pixel).normalized();
    const Eigen::Vector3d from = eye - centre;
    const double along = from.dot(direction);
    const double discriminant = along * along - (from.squaredNorm() - radius * radius);
    const double distance = std::sqrt(discriminant) - along;
    if (!(distance > 0)) return std::nullopt;
    return eye + distance * direction;
  }
};

/// A camera that looks at the focal plane, as seen by the view.
class PlaneView {
 public:
  /// `bend`: how far from straight a border may be taken for straight, in widths of the picture.
  /// `sphere`: in focus in place of the plane; outlives this object.
  PlaneView(const render::PlaneProjection& projection, const rig::Rig::Camera& camera, double bend,
            const FocalSphere* sphere = nullptr)
      : model_(&camera.model),
        tolerance_(bend * camera.model.width()),
        ideal_from_pixel_(projection.ideal_from_pixel(camera.pose)),
        is_straight_(!camera.model.has_distortion() && sphere == nullptr),
        sphere_(sphere),
        pose_(&camera.pose) {
    const schemas::Intrinsics& k = camera.model.intrinsics();
    const auto x = k.fx * ideal_from_pixel_.row(0) + k.cx * ideal_from_pixel_.row(2);
    const auto y = k.fy * ideal_from_pixel_.row(1) + k.cy * ideal_from_pixel_.row(2);
    borders_.row(0) = x;
    borders_.row(1) = camera.model.width() * ideal_from_pixel_.row(2) - x;
    borders_.row(2) = y;
    borders_.row(3) = camera.model.height() * ideal_from_pixel_.row(2) - y;
    if (sphere == nullptr) cosine_ = inscribed_cosine(camera.model);
  }

  /// Returns whether a fisheye sees the point at a pixel in a circular cone about its axis that its
  /// picture contains. Where this holds for the corners of a triangle, it holds for all of it: the
  /// direction is linear in the pixel, and the cone is convex.
  bool is_in_cone(const Eigen::Vector2d& pixel) const {
    if (cosine_ > 1) return false;
    const Eigen::Vector3d direction = ideal_from_pixel_ * Eigen::Vector3d(pixel.x(), pixel.y(), 1);
    return direction.z() >= cosine_ * direction.norm();
  }

  /// Returns whether the borders are linear in the view's pixel.
  bool is_straight() const { return is_straight_; }
  /// Returns how far from linear, pixels, the borders may be taken for linear.
  double tolerance() const { return tolerance_; }
  /// Returns how far inside its borders, in their units, a place certainly stays between others.
  double far_inside() const { return is_straight_ ? 0 : 0.15 * model_->width(); }
  /// Returns after how many halvings of a region that holds.
  int far_inside_from() const { return model_->fisheye() != nullptr ? 3 : 0; }

  Borders borders_at(const Eigen::Vector2d& pixel) const {
    const Eigen::Vector3d at(pixel.x(), pixel.y(), 1);
    if (is_straight_) {
      const Eigen::Vector4d values = borders_ * at;
      return {values(0), values(1), values(2), values(3)};
    }
    const auto found = pixel_of(at);
    if (!found) return scaled(kNowhere);
    return {found->x(), model_->width() - found->x(), found->y(), model_->height() - found->y()};
  }

 private:
  /// Returns the cosine of the half angle of the widest cone, at most a hemisphere, that a
  /// fisheye's picture contains; 2: none.
  static double inscribed_cosine(const rig::CameraModel& model) {
    constexpr double kNone = 2, kRounding = 1e-9;
    if (model.fisheye() == nullptr) return kNone;
    const schemas::Intrinsics& k = model.intrinsics();
    const double nearest = std::min(
        {k.cx / k.fx, (model.width() - k.cx) / k.fx, k.cy / k.fy, (model.height() - k.cy) / k.fy});
    if (!(nearest > 0)) return kNone;
    const double largest = model.fisheye()->largest_angle();
    const double angle = std::min(model.fisheye()->angle(nearest).value_or(largest), largest);
    return std::max(0.0, std::cos(angle)) + kRounding;
  }

  std::optional<Eigen::Vector2d> pixel_of(const Eigen::Vector3d& at) const {
    if (sphere_ == nullptr) return project_ideal(*model_, ideal_from_pixel_ * at);
    const auto point = sphere_->point_at(at);
    return point ? model_->project(pose_->camera_from_world(*point)) : std::nullopt;
  }

  /// Returns borders that are as far outside as the picture is wide.
  Borders scaled(Borders borders) const {
    for (double& border : borders) border *= model_->width();
    return borders;
  }

  const rig::CameraModel* model_;
  double tolerance_;
  Eigen::Matrix3d ideal_from_pixel_;
  Eigen::Matrix<double, kBorders, 3> borders_;
  bool is_straight_;
  double cosine_ = 2;
  const FocalSphere* sphere_;
  const rig::Pose* pose_;
};

/// How the parts of a picture are measured: by its pixels, or by the solid angle of its rays.
class Measure {
 public:
  static Measure pixels() { return {}; }
  /// `ray_from_pixel`: direction of a homogeneous pixel, in any frame.
  /// `halvings`: after which parts of a picture are so small that their areas are in proportion to
  /// their angles.
  static Measure solid_angle(const Eigen::Matrix3d& ray_from_pixel, int halvings = 3) {
    Measure measure;
    measure.halvings_ = halvings;
    measure.is_solid_angle_ = true;
    measure.ray_from_pixel_ = ray_from_pixel;
    return measure;
  }

  bool is_solid_angle() const { return is_solid_angle_; }
  int halvings() const { return halvings_; }

  /// Returns square pixels, or steradians.
  double of_triangle(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                     const Eigen::Vector2d& c) const {
    if (!is_solid_angle_) {
      const Eigen::Vector2d ab = b - a, ac = c - a;
      return std::abs(ab.x() * ac.y() - ac.x() * ab.y()) / 2;
    }
    // Van Oosterom and Strackee, The Solid Angle of a Plane Triangle, 1983.
    const Eigen::Vector3d u = ray(a), v = ray(b), w = ray(c);
    const double volume = std::abs(u.dot((v - u).cross(w - u)));
    return 2 * std::atan2(volume, 1 + u.dot(v) + v.dot(w) + w.dot(u));
  }

 private:
  Eigen::Vector3d ray(const Eigen::Vector2d& pixel) const {
    return (ray_from_pixel_ * Eigen::Vector3d(pixel.x(), pixel.y(), 1)).normalized();
  }

  bool is_solid_angle_ = false;
  int halvings_ = 0;
  Eigen::Matrix3d ray_from_pixel_ = Eigen::Matrix3d::Identity();
};

/// A convex polygon.
class Polygon {
 public:
  void add(const Eigen::Vector2d& corner) { corners_.push_back(corner); }
  bool is_empty() const { return corners_.size() < 3; }
  std::size_t size() const { return corners_.size(); }
  const Eigen::Vector2d& operator[](std::size_t i) const { return corners_[i]; }

  double area() const {
    double twice = 0;
    for (std::size_t i = 2; i < corners_.size(); ++i) {
      const Eigen::Vector2d a = corners_[i - 1] - corners_[0], b = corners_[i] - corners_[0];
      twice += a.x() * b.y() - a.y() * b.x();
    }
    return std::abs(twice) / 2;
  }

  double measured(const Measure& measure) const {
    if (!measure.is_solid_angle()) return area();
    double sum = 0;
    for (std::size_t i = 2; i < corners_.size(); ++i) {
      sum += measure.of_triangle(corners_[0], corners_[i - 1], corners_[i]);
    }
    return sum;
  }

  /// Returns the part where a x + b y + c is not negative.
  Polygon clipped(const Eigen::Vector3d& line) const {
    const auto value = [&](const Eigen::Vector2d& p) {
      return line.x() * p.x() + (line.y() * p.y() + line.z());
    };
    Polygon kept;
    if (is_empty()) return kept;
    double at_from = value(corners_.back());
    const Eigen::Vector2d* from = &corners_.back();
    for (const Eigen::Vector2d& to : corners_) {
      const double at_to = value(to);
      if ((at_from >= 0) != (at_to >= 0)) {
        kept.add(*from + at_from / (at_from - at_to) * (to - *from));
      }
      if (at_to >= 0) kept.add(to);
      from = &to;
      at_from = at_to;
    }
    return kept;
  }

  /// Returns whether a x + b y + c is negative in a part.
  bool reaches_beyond(const Eigen::Vector3d& line) const {
    return std::any_of(corners_.begin(), corners_.end(), [&](const Eigen::Vector2d& p) {
      return line.x() * p.x() + (line.y() * p.y() + line.z()) < 0;
    });
  }

  Eigen::AlignedBox2d box() const {
    Eigen::AlignedBox2d box;
    for (const Eigen::Vector2d& corner : corners_) box.extend(corner);
    return box;
  }

 private:
  boost::container::small_vector<Eigen::Vector2d, 12> corners_;
};

inline constexpr std::size_t kMaxCameras = 3;  // of a cell

/// A position in the view, and what the cell's cameras see of the focal plane there.
struct Corner {
  Eigen::Vector2d at;
  std::array<bool, kMaxCameras> is_in_cone{};
  bool has_borders = false;  ///< they cost the most, and are computed where they are needed
  std::array<Borders, kMaxCameras> borders{};
};

/// The cameras of a cell.
class CellCameras {
 public:
  explicit CellCameras(const Measure& measure = {}) : measure_(measure) {}

  void add(const PlaneView& camera) { cameras_[count_++] = &camera; }

  /// Returns the area of the triangle that at least one camera sees.
  double seen_area(const std::array<Eigen::Vector2d, 3>& triangle) const {
    return seen_area({corner(triangle[0]), corner(triangle[1]), corner(triangle[2])}, 0);
  }

 private:
  using Corners = std::array<Corner, 3>;

  Corner corner(const Eigen::Vector2d& at) const {
    Corner result;
    result.at = at;
    for (std::size_t i = 0; i < count_; ++i) result.is_in_cone[i] = cameras_[i]->is_in_cone(at);
    return result;
  }

  void add_borders(Corners& corners) const {
    for (Corner& corner : corners) {
      if (corner.has_borders) continue;
      corner.has_borders = true;
      for (std::size_t i = 0; i < count_; ++i) {
        corner.borders[i] = cameras_[i]->borders_at(corner.at);
      }
    }
  }

  bool is_in_a_cone(const Corners& corners) const {
    for (std::size_t i = 0; i < count_; ++i) {
      if (corners[0].is_in_cone[i] && corners[1].is_in_cone[i] && corners[2].is_in_cone[i]) {
        return true;
      }
    }
    return false;
  }

  /// Returns whether no camera's borders say anything of a triangle before it is divided.
  bool is_too_coarse(int depth) const {
    return std::all_of(cameras_.begin(), cameras_.begin() + count_,
                       [&](const auto* camera) { return depth < camera->far_inside_from(); });
  }

  double area_of(const Corners& corners) const {
    return measure_.of_triangle(corners[0].at, corners[1].at, corners[2].at);
  }

  /// Returns after how many halvings a triangle that is seen in part may be measured: solid angles
  /// differ between equal areas of a picture.
  int finest_from(const PlaneView& camera) const {
    return std::max(camera.far_inside_from(), measure_.halvings());
  }

  /// Returns how far a camera's borders at the middles of the sides are from the means of those at
  /// their ends, at most.
  static double deviation(const Corners& corners, const Corners& middles, std::size_t camera) {
    double most = 0;
    for (std::size_t side = 0; side < 3; ++side) {
      const Borders &from = corners[side].borders[camera],
                    &to = corners[(side + 1) % 3].borders[camera];
      for (std::size_t k = 0; k < kBorders; ++k) {
        most = std::max(most, std::abs(middles[side].borders[camera][k] - (from[k] + to[k]) / 2));
      }
    }
    return most;
  }

  /// Returns whether a camera sees all of a triangle, so far from its borders that no bend of
  /// theirs matters.
  bool is_clearly_inside(const Corners& corners, int depth) const {
    for (std::size_t i = 0; i < count_; ++i) {
      if (depth < cameras_[i]->far_inside_from()) continue;
      double least = corners[0].borders[i][0];
      for (const Corner& corner : corners) {
        for (const double border : corner.borders[i]) least = std::min(least, border);
      }
      if (least >= cameras_[i]->far_inside()) return true;
    }
    return false;
  }

  double seen_area(Corners corners, int depth) const {
    constexpr int kMaxDepth = 7;
    if (is_in_a_cone(corners)) return area_of(corners);
    if (is_too_coarse(depth)) return divided_area(corners, middles_of(corners), depth);
    add_borders(corners);
    const bool is_curved = std::any_of(cameras_.begin(), cameras_.begin() + count_,
                                       [](const auto* camera) { return !camera->is_straight(); });
    if (is_clearly_inside(corners, depth)) return area_of(corners);
    std::array<double, kMaxCameras> margin{};
    Corners middles;
    bool divide = false;
    if (is_curved || measure_.is_solid_angle()) {
      middles = middles_of(corners);
      if (is_curved) add_borders(middles);
      for (std::size_t i = 0; i < count_ && is_curved; ++i) {
        const double bent = deviation(corners, middles, i);
        margin[i] = 4 * bent;  // distortion may be stronger between the middles
        divide = divide || bent > cameras_[i]->tolerance();
      }
    }
    std::vector<std::size_t> partial;
    partial.reserve(count_);
    for (std::size_t i = 0; i < count_; ++i) {
      double least = corners[0].borders[i][0];
      bool is_outside = false;
      for (std::size_t k = 0; k < kBorders; ++k) {
        const auto [low, high] = std::minmax(
            {corners[0].borders[i][k], corners[1].borders[i][k], corners[2].borders[i][k]});
        least = std::min(least, low);
        is_outside = is_outside || high < -margin[i];
      }
      const bool is_coarse = depth < cameras_[i]->far_inside_from();
      if (least >= margin[i] && !is_coarse) return area_of(corners);
      if (is_outside && !is_coarse) continue;
      divide = divide || depth < finest_from(*cameras_[i]);
      partial.push_back(i);
    }
    if (partial.empty()) return 0;
    if (!divide || depth == kMaxDepth) return union_area(corners, partial);
    return divided_area(corners, middles, depth);
  }

  Corners middles_of(const Corners& corners) const {
    Corners middles;
    for (std::size_t side = 0; side < 3; ++side) {
      middles[side] = corner((corners[side].at + corners[(side + 1) % 3].at) / 2);
    }
    return middles;
  }

  double divided_area(const Corners& corners, const Corners& middles, int depth) const {
    double area = 0;
    for (std::size_t side = 0; side < 3; ++side) {
      area += seen_area({corners[side], middles[side], middles[(side + 2) % 3]}, depth + 1);
    }
    return area + seen_area(middles, depth + 1);
  }

  /// Returns the area that cameras see, with their borders linear within the triangle.
  double union_area(const Corners& corners, const std::vector<std::size_t>& cameras) const {
    double share = 0;  // of the triangle, in barycentric coordinates: its area there is 1/2
    for (unsigned subset = 1; subset < 1U << cameras.size(); ++subset) {
      Polygon polygon;
      for (const Eigen::Vector2d& p :
           {Eigen::Vector2d(0, 0), Eigen::Vector2d(1, 0), Eigen::Vector2d(0, 1)})
        polygon.add(p);
      int members = 0;
      for (std::size_t i = 0; i < cameras.size() && !polygon.is_empty(); ++i) {
        if ((subset >> i & 1U) == 0) continue;
        ++members;
        for (std::size_t k = 0; k < kBorders; ++k) {
          const double origin = corners[0].borders[cameras[i]][k];
          polygon = polygon.clipped({corners[1].borders[cameras[i]][k] - origin,
                                     corners[2].borders[cameras[i]][k] - origin, origin});
        }
      }
      if (!polygon.is_empty()) share += (members % 2 == 1 ? 2 : -2) * polygon.area();
    }
    return share * area_of(corners);
  }

  Measure measure_;
  std::array<const PlaneView*, kMaxCameras> cameras_{};
  std::size_t count_ = 0;
};

}  // namespace raystage::planning
