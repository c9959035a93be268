// SPDX-License-Identifier: Apache-2.0
// Intersects rays with the depth maps of cameras by relief mapping (Policarpo, Oliveira and Comba
// 2005, "Real-time relief mapping on arbitrary polygonal surfaces"). The ray is projected to a
// camera's image and followed pixel by pixel until it passes from in front of the depths to behind
// them; linear interpolation gives the hit. The result is the median over the 3 nearest cameras
// that see the ray. Input: rays, maps in 1/m; output: inverse distances along the rays, 1/m. Cost:
// O(rays x 3 x pixels along the ray, at most 4096), and O(cameras log cameras) per ray to sort
// them.
#include "render/depth/depth_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

namespace raystage::render {
namespace {

using Eigen::Vector3d;

constexpr std::size_t kAsked = 3;          // cameras per ray
constexpr double kMaxSurfaceSteps = 4096;  // along a ray in a camera's image

/// An interval of inverse distances along a ray, 1/m.
struct Stretch {
  double nearest = 0, farthest = 0;
  bool empty() const { return !(farthest <= nearest); }
};

class DepthSurface {
 public:
  DepthSurface(std::shared_ptr<const CameraDepths> depths, const rig::Rig& rig,
               schemas::DepthRange scene)
      : depths_(std::move(depths)),
        centre_(rig.centre()),
        axis_(rig.mean_viewing_direction()),
        looks_around_(rig.looks_around()),
        scene_(scene) {
    for (std::size_t i = 0; i < depths_->maps.size(); ++i) {
      if (depths_->maps[i].values.empty()) continue;
      const VirtualCamera& pinhole = depths_->pinholes[i];
      const schemas::Intrinsics& k = pinhole.intrinsics;
      Eigen::Matrix3d pixel_from_camera;
      pixel_from_camera << k.fx, 0, -k.cx, 0, -k.fy, -k.cy, 0, 0, -1;
      cameras_.push_back({&depths_->maps[i], pinhole.pose.position,
                          pixel_from_camera * pinhole.pose.world_from_camera_rotation.transpose()});
    }
  }

  void operator()(std::span<const WorldRay> rays, std::span<double> inverse_distance) const {
    std::vector<std::pair<double, std::size_t>> by_distance;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      inverse_distance[i] = intersect(rays[i], by_distance);
    }
  }

 private:
  struct Camera {
    const InverseDepthMap* map;
    Vector3d centre;
    Eigen::Matrix3d pixel_from_world;  // for directions; scaled by the planar depth
  };
  struct Hit {
    double inverse_distance = 0;
    bool in_sight = true;  // the camera sees the ray from the scene's near end to the hit
  };

  /// As within_scene(), between spheres about the array: from where the ray leaves the inner one to
  /// where it leaves the outer one.
  Stretch within_spheres(const WorldRay& ray) const {
    const Vector3d from_centre = ray.origin - centre_;
    const double along = from_centre.dot(ray.direction);
    const double beside = (from_centre - along * ray.direction).squaredNorm();
    const auto leaves_at = [&](double radius) {  // not a number: the ray misses the sphere
      return std::sqrt(radius * radius - beside) - along;
    };
    const double to_near = leaves_at(scene_.near), to_far = leaves_at(scene_.far);
    if (!(to_far > 0)) return {0, 1};
    const double limit = 4 / scene_.near;
    return {to_near > 0 ? std::min(limit, 1 / to_near) : limit, 1 / to_far};
  }

  Stretch within_scene(const WorldRay& ray) const {
    if (looks_around_) return within_spheres(ray);
    const double speed = ray.direction.dot(axis_);
    const double start = (ray.origin - centre_).dot(axis_);
    const double to_near = scene_.near - start, to_far = scene_.far - start;
    constexpr Stretch kNothing{0, 1};
    // The search starts at a quarter of the scene's near end from the origin.
    const double limit = 4 / scene_.near;
    if (speed > 0) {
      if (to_far <= 0) return kNothing;
      return {to_near > 0 ? std::min(limit, speed / to_near) : limit, speed / to_far};
    }
    if (speed < 0) {
      if (to_near >= 0) return kNothing;
      return {to_far < 0 ? std::min(limit, speed / to_far) : limit, speed / to_near};
    }
    return to_near <= 0 && to_far >= 0 ? Stretch{limit, 0} : kNothing;
  }

  double intersect(const WorldRay& ray,
                   std::vector<std::pair<double, std::size_t>>& by_distance) const {
    const Stretch scene = within_scene(ray);
    if (scene.empty()) return std::numeric_limits<double>::quiet_NaN();
    by_distance.clear();
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
      const Vector3d beside = cameras_[i].centre - ray.origin;
      by_distance.emplace_back((beside - beside.dot(ray.direction) * ray.direction).squaredNorm(),
                               i);
    }
    // More candidates than needed, as some may not see the ray: many of an array that looks around.
    const std::size_t candidates =
        looks_around_ ? by_distance.size() : std::min(by_distance.size(), 4 * kAsked);
    std::partial_sort(by_distance.begin(),
                      by_distance.begin() + static_cast<std::ptrdiff_t>(candidates),
                      by_distance.end());
    std::array<double, kAsked> clear{}, hidden{};
    std::size_t clear_count = 0, hidden_count = 0;
    for (std::size_t i = 0; i < candidates && clear_count + hidden_count < kAsked; ++i) {
      const auto hit = follow(cameras_[by_distance[i].second], ray, scene);
      if (!hit) continue;
      if (hit->in_sight) {
        clear[clear_count++] = hit->inverse_distance;
      } else {
        hidden[hidden_count++] = hit->inverse_distance;
      }
    }
    if (clear_count > 0) return middle(clear, clear_count);
    if (hidden_count > 0) return middle(hidden, hidden_count);
    return scene.farthest;
  }

  /// Returns the median; of fewer than three values, that of the nearest camera.
  static double middle(std::array<double, kAsked> values, std::size_t count) {
    if (count < kAsked) return values[0];
    std::ranges::sort(values);
    return values[1];
  }

  /// Returns where the ray first passes from in front of a camera's depths to behind them.
  static std::optional<Hit> follow(const Camera& camera, const WorldRay& ray, Stretch scene) {
    // The ray's point at inverse distance q lies at (X, Y, W) = direction + q * parallax, pixel
    // (X/W, Y/W), inverse planar depth q/W.
    const Vector3d direction = camera.pixel_from_world * ray.direction;
    const Vector3d parallax = camera.pixel_from_world * (ray.origin - camera.centre);
    const Stretch seen = within_image(*camera.map, direction, parallax, scene);
    if (seen.empty()) return std::nullopt;
    const auto place = [&](double q) -> Eigen::Vector2d {
      const Vector3d p = direction + q * parallax;
      return {p.x() / p.z(), p.y() / p.z()};
    };
    const double length = (place(seen.nearest) - place(seen.farthest)).lpNorm<Eigen::Infinity>();
    const double steps = std::clamp(std::ceil(length), 1.0, kMaxSurfaceSteps);
    const double step = (seen.nearest - seen.farthest) / steps;
    Hit hit;
    double before = 0, last_q = 0;  // distance in front of the depths, 1/m
    bool is_before = false;
    // If the ray enters the image late, something outside the image may hide it.
    hit.in_sight = seen.nearest == scene.nearest;
    for (int i = 0; i <= static_cast<int>(steps); ++i) {
      const double q = std::max(seen.nearest - i * step, seen.farthest);
      const Vector3d p = direction + q * parallax;
      const int x = std::clamp(static_cast<int>(p.x() / p.z()), 0, camera.map->width - 1);
      const int y = std::clamp(static_cast<int>(p.y() / p.z()), 0, camera.map->height - 1);
      const auto depth = static_cast<double>(camera.map->at(x, y));
      if (depth < 0) continue;  // unknown
      const double ahead = q / p.z() - depth;
      if (ahead > 0) {
        is_before = true;
        before = ahead;
        last_q = q;
        continue;
      }
      // At most two steps behind the surface: a hit. Else the ray passed behind a nearer object.
      const double slack = 2 * step / p.z() + 1e-9 * depth;
      if (-ahead <= slack) {
        const double part = is_before ? before / (before - ahead) : 1;
        hit.inverse_distance = is_before ? last_q + (q - last_q) * part : q;
        return hit;
      }
      hit.in_sight = false;
      is_before = false;
    }
    return std::nullopt;
  }

  static Stretch within_image(const InverseDepthMap& map, const Vector3d& direction,
                              const Vector3d& parallax, Stretch scene) {
    const auto keep = [&scene](double constant, double slope) {  // constant + q * slope >= 0
      if (slope > 0) {
        scene.farthest = std::max(scene.farthest, -constant / slope);
      } else if (slope < 0) {
        scene.nearest = std::min(scene.nearest, -constant / slope);
      } else if (constant < 0) {
        scene = {0, 1};
      }
    };
    keep(direction.x(), parallax.x());
    keep(map.width * direction.z() - direction.x(), map.width * parallax.z() - parallax.x());
    keep(direction.y(), parallax.y());
    keep(map.height * direction.z() - direction.y(), map.height * parallax.z() - parallax.y());
    if (scene.empty()) return scene;
    const double least_w =
        direction.z() + std::min(scene.nearest * parallax.z(), scene.farthest * parallax.z());
    return least_w > 0 ? scene : Stretch{0, 1};
  }

  std::shared_ptr<const CameraDepths> depths_;
  Vector3d centre_, axis_;
  bool looks_around_;
  schemas::DepthRange scene_;
  std::vector<Camera> cameras_;
};

}  // namespace

RaySurface depth_surface(std::shared_ptr<const CameraDepths> depths, const rig::Rig& rig,
                         schemas::DepthRange scene) {
  return DepthSurface(std::move(depths), rig, scene);
}

}  // namespace raystage::render
