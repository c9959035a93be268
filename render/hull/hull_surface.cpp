// SPDX-License-Identifier: Apache-2.0
// Intersects rays with the visual hull of silhouettes (Matusik et al., SIGGRAPH 2000, section 2).
// Each ray is projected to each camera's matte and walked pixel by pixel, skipping uniform areas.
// The intervals on foreground are kept, and the first point seen by at least `min_views` cameras is
// the hit. Input: rays and undistorted mattes; output: inverse distances, 1/m, NaN without a hit.
// Cost: O(rays x cameras x pixels along the ray). Reference: hull_surface_reference.cpp.
#include "render/hull/hull_surface.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>

namespace raystage::render {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// Points closer to a camera's plane than this, relative to their distance, count as not in front.
constexpr double kMinAhead = 1e-12;

/// An interval of inverse distances along a ray, the nearer (larger) first, 1/m.
struct Interval {
  double near = 0, far = 0;
};

/// A silhouette with its projection, from world directions to raster position times W.
struct Carver {
  Matrix3d raster_from_world;
  Vector3d centre;
  const Matte::Raster* raster = nullptr;
};

Carver carver_of(const rig::Rig::Camera& camera, const Matte& matte) {
  const Matte::Raster& raster = matte.raster();
  Matrix3d raster_from_camera;  // camera y up, image y down; looks down -z
  raster_from_camera << raster.fx, 0, -raster.cx, 0, -raster.fy, -raster.cy, 0, 0, -1;
  return {raster_from_camera * camera.pose.world_from_camera_rotation.transpose(),
          camera.pose.position, &raster};
}

/// The projection of an interval of a ray to a raster: a straight line, with a projective relation
/// of position and inverse distance.
class RasterLine {
 public:
  /// Requires both ends to be in front of the camera and in the raster.
  RasterLine(const Vector3d& at_near, const Vector3d& at_far, const Interval& interval,
             const Matte::Raster& raster)
      : w_near_(at_near.z()), w_far_(at_far.z()), interval_(interval) {
    const auto position = [&](const Vector3d& at) {
      const Vector2d size(raster.width, raster.height);
      return Vector2d((at.head<2>() / at.z()).cwiseMax(0).cwiseMin(size));
    };
    from_ = position(at_near);
    way_ = position(at_far) - from_;
  }

  Vector2d position(double s) const { return from_ + s * way_; }
  const Vector2d& way() const { return way_; }
  /// Returns the inverse distance at a position, as a weighted mean of the ends instead of a
  /// difference: from afar all that cameras see is in the last millionth of the interval.
  double inverse_distance(double s) const {
    const double of_near = (1 - s) * w_far_, of_far = s * w_near_;
    return (of_near * interval_.near + of_far * interval_.far) / (of_near + of_far);
  }

 private:
  double w_near_, w_far_;
  Vector2d from_, way_;
  Interval interval_;
};

/// Returns the part of an interval in which the camera sees the ray; far > near if there is none. A
/// point (X, Y, W) = `direction` + inverse distance * `per_inverse` is in the raster if 0 <= X <=
/// width W and 0 <= Y <= height W. This is linear, without a division by W, which may be 0.
Interval seen_part(const Vector3d& direction, const Vector3d& per_inverse,
                   const Matte::Raster& raster, const Interval& interval) {
  Interval seen = interval;
  const auto keep = [&](double at_infinity, double per) {  // the part where this is not negative
    if (per > 0) {
      seen.far = std::max(seen.far, -at_infinity / per);
    } else if (per < 0) {
      seen.near = std::min(seen.near, -at_infinity / per);
    } else if (at_infinity < 0) {
      seen.near = -1;
    }
  };
  keep(direction.z() - kMinAhead, per_inverse.z());
  const std::array<int, 2> size{raster.width, raster.height};
  for (int axis = 0; axis < 2; ++axis) {
    const double most = size[axis];
    keep(direction(axis), per_inverse(axis));
    keep(most * direction.z() - direction(axis), most * per_inverse.z() - per_inverse(axis));
  }
  return seen;
}

/// Walks along the line of an interval in one camera's raster: calls visit(near, far, value) for
/// pieces of equal value, the nearest first, until it returns false.
template <class Visit>
void walk(const WorldRay& ray, const Carver& carver, const Interval& interval, const Visit& visit) {
  const Vector3d direction = carver.raster_from_world * ray.direction;
  const Vector3d per_inverse = carver.raster_from_world * (ray.origin - carver.centre);
  const Matte::Raster& raster = *carver.raster;
  const Interval seen = seen_part(direction, per_inverse, raster, interval);
  if (seen.far > seen.near) {
    visit(interval.near, interval.far, MatteValue::kUnseen);
    return;
  }
  if (seen.near < interval.near && !visit(interval.near, seen.near, MatteValue::kUnseen)) return;
  const auto end = [&](double inverse) {
    Vector3d at = direction + inverse * per_inverse;
    at.z() = std::max(at.z(), kMinAhead);
    return at;
  };
  const RasterLine line(end(seen.near), end(seen.far), seen, raster);
  double reached = seen.near;
  const auto step_to = [&](double s, MatteValue value) {
    const double from = reached;
    reached = std::clamp(line.inverse_distance(s), seen.far, reached);
    return visit(from, reached, value);
  };
  const int steps = std::max(1, static_cast<int>(std::ceil(line.way().cwiseAbs().maxCoeff())));
  MatteValue value = MatteValue::kUnseen;
  for (int step = 0; step < steps; ++step) {
    const Vector2d position = line.position((step + 0.5) / steps);
    const int x = std::clamp(static_cast<int>(position.x()), 0, raster.width - 1);
    const int y = std::clamp(static_cast<int>(position.y()), 0, raster.height - 1);
    const std::size_t at = raster.offset(x, y);
    const MatteValue next = raster.values[at];
    if (step > 0 && next != value && !step_to(static_cast<double>(step) / steps, value)) return;
    value = next;
    // A step is at most a pixel; one less allows for rounding.
    step += std::clamp(raster.uniform_radius.values[at] - 1, 0, steps - 1 - step);
  }
  if (!visit(reached, seen.far, value)) return;
  if (seen.far > interval.far) visit(seen.far, interval.far, MatteValue::kUnseen);
}

/// A change of the number of cameras that see a ray, at an inverse distance.
struct Change {
  double inverse_distance = 0;
  int by = 0;
};

/// Returns the nearest inverse distance that enough cameras see, or -1.
double first_seen(std::vector<Change>& changes, int min_views) {
  // From near to far; where one interval ends and another begins, both include the point.
  std::sort(changes.begin(), changes.end(), [](const Change& a, const Change& b) {
    return a.inverse_distance > b.inverse_distance ||
           (a.inverse_distance == b.inverse_distance && a.by > b.by);
  });
  int seeing = 0;
  for (const Change& change : changes) {
    seeing += change.by;
    if (seeing >= min_views) return change.inverse_distance;
  }
  return -1;
}

/// Intersects several rays at a time, camera by camera: their lines are adjacent in its raster, so
/// the cached pixels of one serve the next.
class Carving {
 public:
  static constexpr std::size_t kRays = 64;

  /// Writes 1 / distance of the first surface, or NaN. `rays`: at most kRays.
  void intersect(std::span<const WorldRay> rays, std::span<const Carver> carvers, int min_views,
                 double nearest, std::span<double> inverse_distance) {
    rays_.resize(std::max(rays_.size(), rays.size()));
    alive_.clear();
    for (std::size_t i = 0; i < rays.size(); ++i) {
      inverse_distance[i] = std::numeric_limits<double>::quiet_NaN();
      rays_[i].kept.assign(1, {1 / nearest, 0});
      alive_.push_back(i);
    }
    for (const Carver& carver : carvers) {
      for (const std::size_t i : alive_) carve(rays[i], carver, rays_[i]);
      std::erase_if(alive_, [&](std::size_t i) { return rays_[i].kept.empty(); });
      if (alive_.empty()) return;
    }
    // The nearest remaining piece of each ray first.
    for (std::size_t piece = 0; !alive_.empty(); ++piece) {
      for (const std::size_t i : alive_) rays_[i].changes.clear();
      for (const Carver& carver : carvers) {
        for (const std::size_t i : alive_) count_seeing(rays[i], carver, rays_[i], piece);
      }
      std::erase_if(alive_, [&](std::size_t i) {
        const double first = first_seen(rays_[i].changes, min_views);
        if (first >= 0) inverse_distance[i] = first;
        return first >= 0 || piece + 1 >= rays_[i].kept.size();
      });
    }
  }

 private:
  struct Ray {
    std::vector<Interval> kept;
    std::vector<Change> changes;
  };

  void carve(const WorldRay& line, const Carver& carver, Ray& ray) {
    next_.clear();
    for (const Interval& interval : ray.kept) {
      walk(line, carver, interval, [&](double near, double far, MatteValue value) {
        if (value != MatteValue::kBackground) keep(near, far);
        return true;
      });
    }
    ray.kept.swap(next_);
  }

  void keep(double near, double far) {
    if (!next_.empty() && next_.back().far <= near) {
      next_.back().far = std::min(next_.back().far, far);
    } else {
      next_.push_back({near, far});
    }
  }

  static void count_seeing(const WorldRay& line, const Carver& carver, Ray& ray,
                           std::size_t piece) {
    walk(line, carver, ray.kept[piece], [&](double near, double far, MatteValue value) {
      if (value == MatteValue::kForeground) {
        ray.changes.push_back({near, 1});
        ray.changes.push_back({far, -1});
      }
      return true;
    });
  }

  std::vector<Ray> rays_;
  std::vector<std::size_t> alive_;  ///< of rays_ that have a piece left and no hit yet
  std::vector<Interval> next_;
};

}  // namespace

RaySurface hull_surface(const rig::Rig& rig, std::vector<Silhouette> silhouettes, int min_views,
                        double nearest) {
  std::vector<Carver> carvers;
  for (const Silhouette& silhouette : silhouettes) {
    carvers.push_back(carver_of(rig.cameras[silhouette.camera], *silhouette.matte));
  }
  struct Scratch {
    std::vector<Carver> in_order;
    Carving carving;
  };
  const auto scratches = std::make_shared<tbb::enumerable_thread_specific<Scratch>>();
  return [carvers = std::move(carvers), held = std::move(silhouettes), scratches, min_views,
          nearest](std::span<const WorldRay> rays, std::span<double> inverse_distance) {
    auto& [in_order, carving] = scratches->local();
    // The nearest cameras first: their lines are short and reject most rays. The rays of one call
    // start at about the same position.
    in_order = carvers;
    if (!rays.empty()) {
      const Vector3d& eye = rays.front().origin;
      std::sort(in_order.begin(), in_order.end(), [&](const Carver& a, const Carver& b) {
        return (a.centre - eye).squaredNorm() < (b.centre - eye).squaredNorm();
      });
    }
    for (std::size_t i = 0; i < rays.size(); i += Carving::kRays) {
      const std::size_t count = std::min(Carving::kRays, rays.size() - i);
      carving.intersect(rays.subspan(i, count), in_order, min_views, nearest,
                        inverse_distance.subspan(i, count));
    }
  };
}

}  // namespace raystage::render
