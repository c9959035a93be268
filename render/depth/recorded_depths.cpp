// SPDX-License-Identifier: Apache-2.0
// Resamples depth maps between the pixels of a recorded picture, with its lens distortion, and
// those of the camera without distortion on which depths are estimated. Each pixel's ray is mapped
// by the lens model; the map there is interpolated within a surface (bilinear in the inverse depth,
// which is exact for planes) and never across edges. Maps hold inverse depths in 1/m. Cost: a
// projection per pixel.
#include "render/depth/recorded_depths.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>

#include "base/parallel.h"

namespace raystage::render {
namespace {

/// Samples of a map, with positions in its pixels from the upper left corner.
class SurfaceSampler {
 public:
  SurfaceSampler(const InverseDepthMap& map, float same_surface)
      : map_(map), same_surface_(same_surface) {}

  /// Returns kUnknownDepth outside of the map, and where the nearest sample is unknown.
  float at(double u, double v) const {
    if (!(u >= 0 && v >= 0 && u <= map_.width && v <= map_.height)) return kUnknownDepth;
    const auto [left, right, across] = neighbours(u, map_.width);
    const auto [top, bottom, down] = neighbours(v, map_.height);
    const float nearest = map_.at(across < 0.5F ? left : right, down < 0.5F ? top : bottom);
    if (nearest < 0) return kUnknownDepth;
    const float a = map_.at(left, top), b = map_.at(right, top), c = map_.at(left, bottom),
                d = map_.at(right, bottom);
    const auto [least, most] = std::minmax({a, b, c, d});
    if (least < 0 || most - least > same_surface_) return nearest;
    const float upper = a + across * (b - a), lower = c + across * (d - c);
    return upper + down * (lower - upper);
  }

 private:
  struct Neighbours {
    int first, second;
    float part;  ///< of `second`
  };
  /// Positions at pixel centres have one neighbour, in spite of rounding.
  static Neighbours neighbours(double position, int size) {
    constexpr double kRounding = 1e-4;
    const double at = std::clamp(position - 0.5, 0.0, size - 1.0);
    const double whole = std::floor(at + kRounding);
    const int first = std::min(static_cast<int>(whole), size - 1);
    const double part = at - whole;
    if (part <= kRounding || first + 1 >= size) return {first, first, 0};
    return {first, first + 1, static_cast<float>(part)};
  }

  const InverseDepthMap& map_;
  float same_surface_;
};

/// Returns the axis of the recorded picture's camera in the axes of `model`: they differ if it is a
/// facet. x right, y up, z behind.
Eigen::Vector3d axis_of(const rig::CameraModel& model) {
  const rig::Facet* facet = model.facet();
  if (facet == nullptr) return {0, 0, -1};
  const Eigen::Vector3d axis = facet->lens_from_facet.row(2);  // x right, y down, z ahead
  return {axis.x(), -axis.y(), -axis.z()};
}

/// Returns the planar depth along `axis` of a point at distance 1 along a direction, or that
/// distance.
double depth_per_distance(DepthQuantity quantity, const Eigen::Vector3d& direction,
                          const Eigen::Vector3d& axis) {
  return quantity == DepthQuantity::kDistance ? 1 : direction.dot(axis) / direction.norm();
}

}  // namespace

DepthQuantity stored_quantity(const rig::CameraModel& model) {
  return model.fisheye() != nullptr ? DepthQuantity::kDistance : DepthQuantity::kPlanar;
}

void convert_recorded_depths(InverseDepthMap& map, const rig::CameraModel& model,
                             DepthQuantity from, DepthQuantity to) {
  if (from == to) return;
  const double across = static_cast<double>(model.width()) / map.width,
               down = static_cast<double>(model.height()) / map.height;
  raystage::parallel_for(0, map.height, [&](int y) {
    for (int x = 0; x < map.width; ++x) {
      float& value = map.at(x, y);
      if (value < 0) continue;
      const auto ray = model.unproject({(x + 0.5) * across, (y + 0.5) * down});
      const double forward = ray ? -ray->z() / ray->norm() : 0;
      if (!(forward > 0)) {
        value = kUnknownDepth;
        continue;
      }
      // 1 / planar = 1 / (forward distance)
      value = static_cast<float>(to == DepthQuantity::kPlanar ? value / forward : value * forward);
    }
  });
}

InverseDepthMap undistorted_depths(const InverseDepthMap& recorded, DepthQuantity quantity,
                                   const rig::CameraModel& model, const VirtualCamera& pinhole,
                                   float same_surface) {
  const SurfaceSampler sampler(recorded, same_surface);
  const Eigen::Vector3d axis = axis_of(model);
  const double across = static_cast<double>(recorded.width) / model.width(),
               down = static_cast<double>(recorded.height) / model.height();
  const schemas::Intrinsics& k = pinhole.intrinsics;
  InverseDepthMap result(pinhole.width, pinhole.height, kUnknownDepth);
  raystage::parallel_for(0, result.height, [&](int y) {
    for (int x = 0; x < result.width; ++x) {
      const Eigen::Vector3d direction((x + 0.5 - k.cx) / k.fx, -(y + 0.5 - k.cy) / k.fy, -1);
      const auto pixel = model.project(direction);
      if (!pixel) continue;
      const float value = sampler.at(pixel->x() * across, pixel->y() * down);
      if (value < 0) continue;
      // A point at planar depth 1 of the pinhole is at distance |direction|.
      const double depth = direction.norm() * depth_per_distance(quantity, direction, axis);
      if (depth > 0) result.at(x, y) = static_cast<float>(value * depth);
    }
  });
  return result;
}

void add_recorded_depths(const InverseDepthMap& undistorted, const VirtualCamera& pinhole,
                         const rig::CameraModel& model, DepthQuantity quantity, float same_surface,
                         InverseDepthMap& into) {
  const SurfaceSampler sampler(undistorted, same_surface);
  const Eigen::Vector3d axis = axis_of(model);
  const schemas::Intrinsics& k = pinhole.intrinsics;
  raystage::parallel_for(0, into.height, [&](int y) {
    for (int x = 0; x < into.width; ++x) {
      const auto ray = model.unproject({x + 0.5, y + 0.5});
      if (!ray || !(ray->z() < 0)) continue;
      const Eigen::Vector3d direction = *ray / -ray->z();
      const float value = sampler.at(direction.x() * k.fx + k.cx, -direction.y() * k.fy + k.cy);
      if (value < 0) continue;
      const double depth = direction.norm() * depth_per_distance(quantity, direction, axis);
      if (depth > 0) into.at(x, y) = static_cast<float>(value / depth);
    }
  });
}

}  // namespace raystage::render
