// SPDX-License-Identifier: Apache-2.0
#include "render/hull/carving.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace raystage {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// Part of a ray between two inverse distances, the nearer (larger) first.
struct Interval {
  double near = 0, far = 0;
};

/// A silhouette with what a ray's line needs of its camera: raster position times W, for a
/// direction of the world.
struct Carver {
  Matrix3d raster_from_world;
  Vector3d centre;
  const Matte::Raster* raster = nullptr;
};

Carver carver_of(const Rig::Camera& camera, const Matte& matte) {
  const Matte::Raster& raster = matte.raster();
  Matrix3d raster_from_camera;  // camera y up, image y down; looks down -z
  raster_from_camera << raster.fx, 0, -raster.cx, 0, -raster.fy, -raster.cy, 0, 0, -1;
  return {raster_from_camera * camera.pose.world_from_camera_rotation.transpose(),
          camera.pose.position, &raster};
}

/// A ray's line in a raster between two inverse distances: a straight line, on which position and
/// inverse distance are related by a projection.
class RasterLine {
 public:
  /// Both ends must lie in front of the camera.
  RasterLine(const Vector3d& at_near, const Vector3d& at_far, const Interval& interval)
      : w_near_(at_near.z()),
        w_far_(at_far.z()),
        from_(at_near.head<2>() / w_near_),
        way_(at_far.head<2>() / w_far_ - from_),
        interval_(interval) {}

  Vector2d position(double s) const { return from_ + s * way_; }
  const Vector2d& way() const { return way_; }
  double inverse_distance(double s) const {
    const double along = s * w_near_, t = along / (along + (1 - s) * w_far_);
    return interval_.near + t * (interval_.far - interval_.near);
  }

  /// The part of the line, 0 to 1, within [0, width] x [0, height]; false for none.
  bool clip(double width, double height, double& first, double& last) const {
    first = 0;
    last = 1;
    const Vector2d size(width, height);
    for (int axis = 0; axis < 2; ++axis) {
      if (way_(axis) == 0) {
        if (from_(axis) < 0 || from_(axis) > size(axis)) return false;
        continue;
      }
      const auto [enter, leave] =
          std::minmax({-from_(axis) / way_(axis), (size(axis) - from_(axis)) / way_(axis)});
      first = std::max(first, enter);
      last = std::min(last, leave);
    }
    return first < last || (first == last && way_.isZero(0));
  }

 private:
  double w_near_, w_far_;
  Vector2d from_, way_;
  Interval interval_;
};

/// One thread's work: intervals of one ray.
class RayCarving {
 public:
  /// 1 / distance of the first surface, or not-a-number.
  double meet(const WorldRay& ray, std::span<const Carver> carvers, int least_seeing,
              double nearest) {
    kept_.assign(1, {1 / nearest, 0});
    for (const Carver& carver : carvers) {
      next_.clear();
      for (const Interval& interval : kept_) carve(ray, carver, interval);
      kept_.swap(next_);
      if (kept_.empty()) return std::numeric_limits<double>::quiet_NaN();
    }
    for (const Interval& interval : kept_) {
      const double first = first_seen(ray, carvers, interval, least_seeing);
      if (first >= 0) return first;
    }
    return std::numeric_limits<double>::quiet_NaN();
  }

 private:
  void keep(double near, double far) {
    if (!next_.empty() && next_.back().far <= near) {
      next_.back().far = std::min(next_.back().far, far);
    } else {
      next_.push_back({near, far});
    }
  }

  /// Walks over the line of an interval: calls visit(near, far, value) for pieces of one value, the
  /// nearest first, until it returns false.
  template <class Visit>
  static void walk(const WorldRay& ray, const Carver& carver, Interval interval,
                   const Visit& visit) {
    const Vector3d direction = carver.raster_from_world * ray.direction;
    const Vector3d per_inverse = carver.raster_from_world * (ray.origin - carver.centre);
    const auto at = [&](double inverse) { return Vector3d(direction + inverse * per_inverse); };
    const double w_near = at(interval.near).z(), w_far = at(interval.far).z();
    // What lies behind the camera, or all but beside it, is unseen: beside it lies what is a
    // million pixels off. Measured where the line comes nearest to passing the camera, as seen from
    // afar all of what cameras see can lie in the last millionth of the interval.
    const double beside = std::clamp(per_inverse.z() == 0 ? 0 : -direction.z() / per_inverse.z(),
                                     interval.far, interval.near);
    const Vector3d off = at(beside);
    constexpr double kPixels = 1e6, kRounding = 1e-12;
    const double least_w = std::max(std::max(std::abs(off.x()), std::abs(off.y())) / kPixels,
                                    kRounding * std::abs(direction.z()));
    if (!(w_near > least_w) && !(w_far > least_w)) {
      visit(interval.near, interval.far, MatteValue::kUnseen);
      return;
    }
    const double limit =
        std::clamp((least_w - direction.z()) / per_inverse.z(), interval.far, interval.near);
    Interval ahead = interval;
    if (!(w_near > least_w)) {
      if (!visit(interval.near, limit, MatteValue::kUnseen)) return;
      ahead.near = limit;
    }
    if (!(w_far > least_w)) ahead.far = limit;

    Vector3d near_end = at(ahead.near), far_end = at(ahead.far);
    near_end.z() = std::max(near_end.z(), least_w);
    far_end.z() = std::max(far_end.z(), least_w);
    const RasterLine line(near_end, far_end, ahead);
    double first = 0, last = 0;
    if (!line.clip(carver.raster->width, carver.raster->height, first, last)) {
      visit(ahead.near, interval.far, MatteValue::kUnseen);
      return;
    }
    double reached = ahead.near;
    const auto step_to = [&](double s, MatteValue value) {
      const double from = reached;
      reached = s >= 1 ? ahead.far : std::min(reached, line.inverse_distance(s));
      return visit(from, reached, value);
    };
    if (first > 0 && !step_to(first, MatteValue::kUnseen)) return;
    const double length = line.way().cwiseAbs().maxCoeff() * (last - first);
    const int steps = std::max(1, static_cast<int>(std::ceil(length)));
    const Matte::Raster& raster = *carver.raster;
    const auto value_at = [&](int step) {
      const Vector2d position = line.position(first + (last - first) * (step + 0.5) / steps);
      const int x = std::clamp(static_cast<int>(position.x()), 0, raster.width - 1);
      const int y = std::clamp(static_cast<int>(position.y()), 0, raster.height - 1);
      return raster.values[static_cast<std::size_t>(y) * static_cast<std::size_t>(raster.width) +
                           static_cast<std::size_t>(x)];
    };
    MatteValue value = value_at(0);
    for (int step = 1; step < steps; ++step) {
      const MatteValue next = value_at(step);
      if (next == value) continue;
      if (!step_to(first + (last - first) * step / steps, value)) return;
      value = next;
    }
    if (!step_to(last, value)) return;
    if (reached > interval.far) visit(reached, interval.far, MatteValue::kUnseen);
  }

  void carve(const WorldRay& ray, const Carver& carver, const Interval& interval) {
    walk(ray, carver, interval, [&](double near, double far, MatteValue value) {
      if (value != MatteValue::kBackground) keep(near, far);
      return true;
    });
  }

  /// The nearest inverse distance of an interval that enough cameras see; -1 for none.
  double first_seen(const WorldRay& ray, std::span<const Carver> carvers, const Interval& interval,
                    int least_seeing) {
    changes_.clear();
    for (const Carver& carver : carvers) {
      walk(ray, carver, interval, [&](double near, double far, MatteValue value) {
        if (value == MatteValue::kForeground) {
          changes_.push_back({near, 1});
          changes_.push_back({far, -1});
        }
        return true;
      });
    }
    // From near to far; where one camera gives way to another, both see the point.
    std::sort(changes_.begin(), changes_.end(), [](const Change& a, const Change& b) {
      return a.inverse_distance > b.inverse_distance ||
             (a.inverse_distance == b.inverse_distance && a.by > b.by);
    });
    int seeing = 0;
    for (const Change& change : changes_) {
      seeing += change.by;
      if (seeing >= least_seeing) return change.inverse_distance;
    }
    return -1;
  }

  /// By how many more cameras see a ray from there on.
  struct Change {
    double inverse_distance = 0;
    int by = 0;
  };

  std::vector<Change> changes_;
  std::vector<Interval> kept_, next_;
};

}  // namespace

RaySurface hull_surface(const Rig& rig, std::vector<Silhouette> silhouettes, int least_seeing,
                        double nearest) {
  std::vector<Carver> carvers;
  for (const Silhouette& silhouette : silhouettes) {
    carvers.push_back(
        carver_of(rig.cameras[static_cast<std::size_t>(silhouette.camera)], *silhouette.matte));
  }
  return [carvers = std::move(carvers), held = std::move(silhouettes), least_seeing, nearest](
             std::span<const WorldRay> rays, std::span<double> inverse_distance) {
    // The nearest cameras first: their lines are short, and say of most rays that they miss. Rays
    // that come together come from about the same place.
    std::vector<Carver> in_order = carvers;
    if (!rays.empty()) {
      const Vector3d& eye = rays.front().origin;
      std::sort(in_order.begin(), in_order.end(), [&](const Carver& a, const Carver& b) {
        return (a.centre - eye).squaredNorm() < (b.centre - eye).squaredNorm();
      });
    }
    RayCarving carving;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      inverse_distance[i] = carving.meet(rays[i], in_order, least_seeing, nearest);
    }
  };
}

}  // namespace raystage
