// SPDX-License-Identifier: Apache-2.0
// Computes from where several arrays show a view (thesis 6.2). A position counts if the arrays
// recorded the share of the rays of every orientation and eye; the border of these positions is
// searched for along directions from the middle of the cameras. Cost: some 40 evaluations of
// CombinedArrays::recorded_share() a vertex.
#include "planning/combined_coverage.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "base/error.h"
#include "planning/complete_topology.h"
#include "planning/coverage_views.h"
#include "planning/outward_coverage.h"
#include "rig/planning/combined_arrays.h"

namespace raystage::planning {
namespace {

using Eigen::Vector3d;

constexpr double kRadiansPerDegree = std::numbers::pi / 180;
constexpr double kShareRounding = 1e-9;  // of shares
constexpr std::size_t kMaxArrays = 64;
constexpr std::size_t kMaxCorners = 64;  // of an array's outline
constexpr double kLargestStep = 5;       // between orientations, degrees

/// An array with what the report says of it.
struct PlannedArray {
  rig::MemberArray member;
  CoverageArray description;
};

/// Returns a polygon of at most kMaxCorners of a convex polygon's corners.
std::vector<Eigen::Vector2d> inner_outline(std::vector<Eigen::Vector2d> hull) {
  if (hull.size() <= kMaxCorners) return hull;
  std::vector<Eigen::Vector2d> kept;
  for (std::size_t i = 0; i < kMaxCorners; ++i) {
    kept.push_back(hull[i * hull.size() / kMaxCorners]);
  }
  return kept;
}

/// Returns the convex hull of points or, if that has more than kMaxCorners, a polygon around it.
std::vector<Eigen::Vector2d> outer_outline(std::vector<Eigen::Vector2d> points) {
  std::vector<Eigen::Vector2d> hull = rig::convex_hull(std::move(points), 0);
  if (hull.size() <= kMaxCorners) return hull;
  // Corners of the lines that touch the hull in equally spaced directions.
  std::vector<Eigen::Vector2d> corners;
  const double step = 2 * std::numbers::pi / kMaxCorners;
  const auto normal = [&](std::size_t i) {
    const double angle = step * static_cast<double>(i);
    return Eigen::Vector2d(std::cos(angle), std::sin(angle));
  };
  const auto touching = [&](const Eigen::Vector2d& direction) {
    double farthest = -std::numeric_limits<double>::infinity();
    for (const Eigen::Vector2d& corner : hull) {
      farthest = std::max(farthest, direction.dot(corner));
    }
    return farthest;
  };
  for (std::size_t i = 0; i < kMaxCorners; ++i) {
    const Eigen::Vector2d a = normal(i), b = normal(i + 1);
    Eigen::Matrix2d lines;
    lines << a.transpose(), b.transpose();
    corners.emplace_back(lines.inverse() * Eigen::Vector2d(touching(a), touching(b)));
  }
  return corners;
}

PlannedArray planned_array(const NamedRig& named) {
  if (is_outward_array(named.rig)) {
    throw Error::bad_input("its cameras look outwards, and such an array is planned alone",
                           named.name, "Give this rig without others");
  }
  std::string reason;
  std::optional<rig::RecordedArray> recorded = rig::recorded_array(named.rig, &reason);
  if (!recorded || recorded->array.hull.size() < 3) {
    throw Error::bad_input(recorded ? "the cameras are on a line or in one place" : reason,
                           named.name,
                           "Give arrays of several rows and columns whose cameras face alike");
  }
  rig::WallEyedArray& rays = recorded->array;
  std::vector<Eigen::Vector2d> centres;
  for (const rig::Rig::Camera& camera : named.rig.cameras) {
    centres.emplace_back(rays.pose.camera_from_world(camera.pose.position).head<2>());
  }
  PlannedArray array;
  array.description.name = named.name;
  array.description.cameras = static_cast<int>(named.rig.cameras.size());
  array.description.is_ideal = recorded->is_ideal;
  array.description.size_m = rays.size();
  const Eigen::Vector2d least = rays.slopes.least, largest = rays.slopes.largest;
  for (int axis = 0; axis < 2; ++axis) {
    array.description.fov_deg[axis] =
        (std::atan(largest[axis]) - std::atan(least[axis])) / kRadiansPerDegree;
  }
  rays.hull = inner_outline(std::move(rays.hull));
  array.member = {std::move(rays), {}, outer_outline(std::move(centres))};
  if (!recorded->is_ideal) {
    array.member.cells = rig::RecordedCells(named.rig, complete_topology(named.rig));
  }
  return array;
}

void throw_if_stopped(const std::stop_token& stop, const std::string& name) {
  if (stop.stop_requested()) {
    throw Error::failed("the computation was stopped", name, "Start it again");
  }
}

class CombinedPlanner {
 public:
  CombinedPlanner(std::span<const NamedRig> rigs, const CoverageOptions& options,
                  const std::stop_token& stop)
      : options_(options), stop_(stop) {
    std::vector<rig::MemberArray> members;
    for (const NamedRig& named : rigs) {
      throw_if_stopped(stop, named.name);
      PlannedArray array = planned_array(named);
      descriptions_.push_back(std::move(array.description));
      members.push_back(std::move(array.member));
    }
    frame_.world_from_camera_rotation = members.front().rays.pose.world_from_camera_rotation;
    for (const NamedRig& named : rigs) {
      for (const rig::Rig::Camera& camera : named.rig.cameras) {
        box_.extend(Vector3d(frame_.world_from_camera_rotation.transpose() * camera.pose.position));
      }
    }
    frame_.position = frame_.world_from_camera_rotation * box_.center();
    box_.translate(-box_.center().eval());
    members_ = members;
    arrays_.emplace(std::move(members), options.arrays_hide_each_other);
  }

  const rig::Pose& frame() const { return frame_; }
  std::vector<CoverageArray> descriptions() const { return descriptions_; }

  CoverageVolume volume(double fov_deg, double share) const {
    const Views views = views_of(fov_deg);
    CoverageVolume volume;
    volume.view_fov_deg = fov_deg;
    volume.share = share;
    const auto has_share = [&](const Vector3d& position) {
      return !stop_.stop_requested() &&
             recorded_share(views, position, share) >= share - kShareRounding;
    };
    const std::vector<Vector3d> positions = candidates(views);
    const auto centre = std::ranges::find_if(positions, has_share);
    if (centre == positions.end()) {
      volume.empty_because = fmt::format(
          "no position was found with {:.4g} % of the rays; in the middle of the cameras {:.1f} % "
          "were recorded",
          100 * share, 100 * recorded_share(views, Vector3d::Zero(), 0));
      return volume;
    }
    RadialSurface found = radial_surface(has_share, *centre,
                                         {.reach = reach(views),
                                          .tolerance = options_.tolerance_m,
                                          .max_vertices = options_.max_vertices,
                                          .stop = stop_});
    volume.empty_because = why_too_thin(found.surface, options_.tolerance_m, share, *centre);
    if (!volume.empty_because.empty()) return volume;
    volume.surface = std::move(found.surface);
    volume.error_m = found.error;
    volume.is_in_parts = std::ranges::any_of(positions, [&](const Vector3d& position) {
      return has_share(position) && !is_joined(*centre, position, has_share);
    });
    return volume;
  }

  CoverageSubjectView subject_view(const CoverageSubject& subject) const {
    const auto seen = arrays_->seen_point(
        frame_.world_from_camera(Vector3d(subject.x_m, subject.y_m, -subject.depth_m)));
    return {seen.share, seen.arrays};
  }

 private:
  /// The views of a volume.
  struct Views {
    rig::SlopeRange slopes;
    std::vector<Eigen::Matrix3d> rotations;  ///< in the frame
  };

  Views views_of(double fov_deg) const {
    if (options_.all_directions) return {};
    const render::VirtualCamera view = coverage_view(options_, fov_deg);
    constexpr double kSmallestStep = 0.5;  // bounds the cost of narrow views
    const double step = std::clamp(fov_deg / 2, kSmallestStep, kLargestStep);
    return {rig::camera_slopes(view.intrinsics, view.width, view.height),
            view_rotations(options_, frame_.world_from_camera_rotation, step)};
  }

  /// Returns the least share of all orientations and eyes, or any share below `enough`.
  double recorded_share(const Views& views, const Vector3d& position, double enough) const {
    if (options_.all_directions) {
      return arrays_->recorded_share_of_all(frame_.world_from_camera(position));
    }
    double least = 1;
    for (const Eigen::Matrix3d& rotation : views.rotations) {
      const Eigen::Matrix3d world_from_view = frame_.world_from_camera_rotation * rotation;
      for (const double side : {-0.5, 0.5}) {
        const Vector3d eye = frame_.world_from_camera(position) +
                             side * options_.interaxial_m * world_from_view.col(0);
        least = std::min(least, arrays_->recorded_share(eye, {views.slopes, world_from_view}));
        if (least < enough - kShareRounding || options_.interaxial_m == 0) break;
      }
      if (least < enough - kShareRounding) break;
    }
    return least;
  }

  /// Returns positions from the middle of the cameras outwards: of a grid that is larger than the
  /// arrays, because two of them side by side may be shown together behind them only; and for each
  /// array its middle, and that of its own range.
  std::vector<Vector3d> candidates(const Views& views) const {
    constexpr int kSteps = 4;  // to each side
    const double step = box_.sizes().maxCoeff() / kSteps;
    std::vector<Vector3d> positions;
    for (int z = -kSteps; z <= kSteps; ++z) {
      for (int y = -kSteps; y <= kSteps; ++y) {
        for (int x = -kSteps; x <= kSteps; ++x) positions.emplace_back(step * Vector3d(x, y, z));
      }
    }
    for (const rig::MemberArray& member : members_) {
      positions.push_back(frame_.camera_from_world(member.rays.pose.position));
      for (const Eigen::Matrix3d& rotation : views.rotations) {
        const rig::RangeOfMotion range = rig::range_of_motion(
            member.rays,
            {views.slopes, frame_.world_from_camera_rotation * rotation, options_.interaxial_m});
        if (range.positions.is_empty()) continue;
        Vector3d sum = Vector3d::Zero();
        for (const Vector3d& vertex : range.positions.vertices()) sum += vertex;
        sum /= static_cast<double>(range.positions.vertices().size());
        positions.push_back(frame_.camera_from_world(member.rays.pose.world_from_camera(sum)));
      }
    }
    std::ranges::stable_sort(positions, {}, &Vector3d::squaredNorm);
    return positions;
  }

  /// Returns whether the way from one position to another is inside.
  template <class IsInside>
  static bool is_joined(const Vector3d& from, const Vector3d& to, const IsInside& is_inside) {
    constexpr int kParts = 20;
    for (int i = 1; i < kParts; ++i) {
      if (!is_inside(from + static_cast<double>(i) / kParts * (to - from))) return false;
    }
    return true;
  }

  /// Returns how far from the middle a view may be: beyond, its outermost rays do not cross the
  /// arrays.
  double reach(const Views& views) const {
    const Eigen::Vector2d size = views.slopes.largest - views.slopes.least;
    const double slopes = options_.all_directions ? 1 : size.maxCoeff();
    return box_.diagonal().norm() * (1.5 + 2 / slopes);
  }

  const CoverageOptions& options_;
  std::stop_token stop_;
  std::vector<CoverageArray> descriptions_;
  std::vector<rig::MemberArray> members_;
  std::optional<rig::CombinedArrays> arrays_;
  rig::Pose frame_;
  Eigen::AlignedBox3d box_;  // of the cameras, in the frame
};

void check_options(const std::string& name, const CoverageOptions& options) {
  std::string reason;
  const auto refuse = [&](const std::string& why) {
    return Error::bad_input(why, name, "Correct the views");
  };
  if (!options.is_valid(&reason)) throw refuse(reason);
  if (std::isfinite(options.focal_depth_m)) {
    throw refuse("several arrays, and views of all directions, have no common focal plane");
  }
  if (options.all_directions && options.interaxial_m > 0) {
    throw refuse("views of all directions have one eye");
  }
}

/// The same cameras twice are still one array.
void check_arrays_differ(std::span<const NamedRig> arrays) {
  for (std::size_t i = 0; i < arrays.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (!have_same_cameras(arrays[i].rig, arrays[j].rig)) continue;
      throw Error::bad_input("its cameras are at the same places as those of " + arrays[j].name,
                             arrays[i].name, "Give each array once");
    }
  }
}

}  // namespace

bool have_same_cameras(const rig::Rig& a, const rig::Rig& b) {
  constexpr double kSamePlace = 1e-9;
  return std::ranges::equal(a.cameras, b.cameras,
                            [&](const rig::Rig::Camera& one, const rig::Rig::Camera& other) {
                              return (one.pose.position - other.pose.position).norm() <=
                                         kSamePlace * (1 + one.pose.position.norm()) &&
                                     one.pose.world_from_camera_rotation.isApprox(
                                         other.pose.world_from_camera_rotation, kSamePlace);
                            });
}

std::vector<NamedRig> split_by_direction(const NamedRig& named) {
  if (is_outward_array(named.rig)) return {named};
  return split_into_sides(named);
}

std::vector<NamedRig> split_into_sides(const NamedRig& named) {
  constexpr double kOneArray = 80 * kRadiansPerDegree, kOneSide = 40 * kRadiansPerDegree;
  const Vector3d mean = named.rig.mean_viewing_direction();
  const bool is_one = std::ranges::all_of(named.rig.cameras, [&](const rig::Rig::Camera& camera) {
    return camera.pose.viewing_direction().dot(mean) > std::cos(kOneArray);
  });
  if (is_one) return {named};
  std::vector<NamedRig> sides;
  for (const rig::Rig::Camera& camera : named.rig.cameras) {
    const auto side = std::ranges::find_if(sides, [&](const NamedRig& one) {
      return camera.pose.viewing_direction().dot(one.rig.cameras[0].pose.viewing_direction()) >
             std::cos(kOneSide);
    });
    if (side != sides.end()) {
      side->rig.cameras.push_back(camera);
      continue;
    }
    NamedRig added = named;
    added.name = fmt::format("{}, side {}", named.name, sides.size() + 1);
    added.rig.cameras = {camera};
    sides.push_back(std::move(added));
  }
  return sides;
}

CoveragePlan plan_combined_coverage(const std::string& name, std::span<const NamedRig> arrays,
                                    const CoverageOptions& options,
                                    const std::function<void(double)>& progress,
                                    const std::stop_token& stop) {
  check_options(name, options);
  if (arrays.empty()) throw Error::bad_input("there is no array", name, "Give a rig");
  if (arrays.size() > kMaxArrays) {
    throw Error::bad_input(
        fmt::format("there are {} arrays, allowed: {} at most", arrays.size(), kMaxArrays), name,
        "Give fewer rigs, or cameras that face alike");
  }
  check_arrays_differ(arrays);
  const CombinedPlanner planner(arrays, options, stop);
  CoveragePlan plan;
  plan.name = name;
  plan.options = options;
  plan.array = planner.frame();
  plan.arrays = planner.descriptions();
  for (const NamedRig& array : arrays) {
    for (const rig::Rig::Camera& camera : array.rig.cameras) {
      plan.cameras.push_back(plan.array.camera_from_world(camera.pose.position));
    }
  }
  const std::vector<double> fovs = coverage_fovs(options);
  for (const double fov : fovs) {
    for (const double share : options.shares) {
      plan.volumes.push_back(planner.volume(fov, share));
      throw_if_stopped(stop, name);
      if (progress) {
        progress(static_cast<double>(plan.volumes.size()) /
                 static_cast<double>(fovs.size() * options.shares.size()));
      }
    }
  }
  if (options.subject) plan.subject_view = planner.subject_view(*options.subject);
  return plan;
}

}  // namespace raystage::planning
