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
#include <numbers>
#include <optional>
#include <utility>

#include "base/error.h"
#include "planning/complete_topology.h"
#include "planning/coverage_views.h"
#include "rig/planning/combined_arrays.h"
#include "rig/topology.h"

namespace raystage::planning {
namespace {

using Eigen::Vector3d;

constexpr double kRadiansPerDegree = std::numbers::pi / 180;
constexpr double kShareRounding = 1e-9;  // of shares

/// An array with what the report says of it.
struct PlannedArray {
  rig::MemberArray member;
  CoverageArray description;
};

PlannedArray planned_array(const NamedRig& named) {
  std::string reason;
  std::optional<rig::WallEyedArray> rays = rig::find_wall_eyed_array(named.rig);
  const bool is_ideal = rays.has_value();
  if (!rays) {
    rays = rig::inscribed_wall_eyed_array(named.rig, complete_topology(named.rig), &reason);
  }
  if (!rays || rays->hull.size() < 3) {
    throw Error::bad_input(rays ? "the cameras are on a line or in one place" : reason, named.name,
                           "Give arrays of several rows and columns whose cameras face alike");
  }
  std::vector<Eigen::Vector2d> centres;
  for (const rig::Rig::Camera& camera : named.rig.cameras) {
    centres.emplace_back(rays->pose.camera_from_world(camera.pose.position).head<2>());
  }
  PlannedArray array;
  array.description.name = named.name;
  array.description.cameras = static_cast<int>(named.rig.cameras.size());
  array.description.is_ideal = is_ideal;
  array.description.size_m = rays->size();
  const Eigen::Vector2d least = rays->slopes.least, largest = rays->slopes.largest;
  for (int axis = 0; axis < 2; ++axis) {
    array.description.fov_deg[axis] =
        (std::atan(largest[axis]) - std::atan(least[axis])) / kRadiansPerDegree;
  }
  array.member = {std::move(*rays), rig::convex_hull(std::move(centres), 0)};
  return array;
}

class CombinedPlanner {
 public:
  CombinedPlanner(std::span<const NamedRig> rigs, const CoverageOptions& options,
                  const std::stop_token& stop)
      : options_(options), stop_(stop), rotations_(view_rotations(options)) {
    std::vector<rig::MemberArray> members;
    for (const NamedRig& named : rigs) {
      PlannedArray array = planned_array(named);
      is_ideal_ = is_ideal_ && array.description.is_ideal;
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
    arrays_.emplace(std::move(members), options.arrays_hide_each_other);
  }

  const rig::Pose& frame() const { return frame_; }
  std::vector<CoverageArray> descriptions() const { return descriptions_; }

  CoverageVolume volume(double fov_deg, double share) const {
    CoverageVolume volume;
    volume.view_fov_deg = fov_deg;
    volume.share = share;
    volume.is_lower_bound = !is_ideal_;
    const auto has_share = [&](const Vector3d& position) {
      return recorded_share(fov_deg, position, share) >= share - kShareRounding;
    };
    const std::optional<Vector3d> centre = find_centre(has_share);
    if (!centre) {
      volume.empty_because = fmt::format(
          "no position was found with {:.4g} % of the rays; in the middle of the cameras {:.1f} % "
          "were recorded",
          100 * share, 100 * recorded_share(fov_deg, Vector3d::Zero(), 0));
      return volume;
    }
    constexpr int kMaxVertices = 4000;
    RadialSurface found = radial_surface(has_share, *centre,
                                         {.reach = reach(),
                                          .tolerance = options_.tolerance_m,
                                          .max_vertices = kMaxVertices,
                                          .stop = stop_});
    Eigen::AlignedBox3d around;
    for (const Vector3d& vertex : found.surface.vertices) around.extend(vertex);
    if (around.sizes().minCoeff() < options_.tolerance_m) {
      volume.empty_because = fmt::format(
          "only one position ({:.3f}, {:.3f}, {:.3f}) has {:.4g} % of the rays, none around it",
          centre->x(), centre->y(), centre->z(), 100 * share);
      return volume;
    }
    volume.surface = std::move(found.surface);
    volume.error_m = found.error;
    volume.is_in_parts = std::ranges::any_of(candidates(), [&](const Vector3d& position) {
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
  /// Returns the least share of all orientations and eyes, or any share below `enough`.
  double recorded_share(double fov_deg, const Vector3d& position, double enough) const {
    if (options_.all_directions) {
      return arrays_->recorded_share_of_all(frame_.world_from_camera(position));
    }
    const render::VirtualCamera view = coverage_view(fov_deg, options_.aspect);
    const rig::SlopeRange slopes = rig::camera_slopes(view.intrinsics, view.width, view.height);
    double least = 1;
    for (const Eigen::Matrix3d& rotation : rotations_) {
      const Eigen::Matrix3d world_from_view = frame_.world_from_camera_rotation * rotation;
      for (const double side : {-0.5, 0.5}) {
        const Vector3d eye = frame_.world_from_camera(position) +
                             side * options_.interaxial_m * world_from_view.col(0);
        least = std::min(least, arrays_->recorded_share(eye, {slopes, world_from_view}));
        if (least < enough - kShareRounding || options_.interaxial_m == 0) break;
      }
      if (least < enough - kShareRounding) break;
    }
    return least;
  }

  /// Returns the positions of a grid, from the middle of the cameras outwards. It is larger than
  /// the arrays: two of them side by side may be shown together behind them only.
  std::vector<Vector3d> candidates() const {
    constexpr int kSteps = 4;  // to each side
    const double step = box_.sizes().maxCoeff() / kSteps;
    std::vector<Vector3d> positions;
    for (int z = -kSteps; z <= kSteps; ++z) {
      for (int y = -kSteps; y <= kSteps; ++y) {
        for (int x = -kSteps; x <= kSteps; ++x) positions.emplace_back(step * Vector3d(x, y, z));
      }
    }
    std::ranges::stable_sort(positions, {}, &Vector3d::squaredNorm);
    return positions;
  }

  template <class IsInside>
  std::optional<Vector3d> find_centre(const IsInside& is_inside) const {
    for (const Vector3d& position : candidates()) {
      if (!stop_.stop_requested() && is_inside(position)) return position;
    }
    return std::nullopt;
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

  /// Returns how far from the middle a view may be.
  double reach() const { return 4 * box_.diagonal().norm(); }

  const CoverageOptions& options_;
  std::stop_token stop_;
  std::vector<Eigen::Matrix3d> rotations_;  // of the views, in the frame
  std::vector<CoverageArray> descriptions_;
  std::optional<rig::CombinedArrays> arrays_;
  rig::Pose frame_;
  Eigen::AlignedBox3d box_;  // of the cameras, in the frame
  bool is_ideal_ = true;
};

void check_options(const std::string& name, const CoverageOptions& options) {
  std::string reason;
  const auto refuse = [&](const std::string& why) {
    return Error::bad_input(why, name, "Correct the views");
  };
  if (!options.is_valid(&reason)) throw refuse(reason);
  if (std::isfinite(options.focal_depth_m)) {
    throw refuse("several arrays have no common focal plane");
  }
  if (options.all_directions && options.interaxial_m > 0) {
    throw refuse("views of all directions have one eye");
  }
}

}  // namespace

std::vector<NamedRig> split_by_direction(const NamedRig& named) {
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
  constexpr double kAllAround = 360;
  const std::vector<double> fovs =
      options.all_directions ? std::vector{kAllAround} : options.view_fov_deg;
  for (const double fov : fovs) {
    for (const double share : options.shares) {
      plan.volumes.push_back(planner.volume(fov, share));
      if (stop.stop_requested()) {
        throw Error::failed("the computation was stopped", name, "Start it again");
      }
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
