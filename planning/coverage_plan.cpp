// SPDX-License-Identifier: Apache-2.0
// Computes from where a view can be rendered (thesis 5.2, 7.2). A position counts if the cameras
// recorded the share of the rays of every orientation and eye. For ideal arrays and all rays the
// range is the intersection of convex polyhedra; otherwise its border is searched for along
// directions from the array's middle. Cost: some 30 evaluations of unrecorded_share() a vertex.
#include "planning/coverage_plan.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "base/error.h"
#include "planning/complete_topology.h"
#include "planning/coverage_views.h"
#include "planning/outward_coverage.h"
#include "planning/recorded_rays.h"
#include "rig/planning/range_of_motion.h"
#include "rig/planning/wall_eyed_array.h"
#include "rig/topology.h"

namespace raystage::planning {
namespace {

using Eigen::Vector3d;

/// The frame of any array: in the middle of its centres, its cameras look along -z.
rig::Pose frame_of(const rig::Rig& rig, const rig::Topology& topology) {
  if (const auto ideal = rig::find_wall_eyed_array(rig)) return ideal->pose;
  if (const auto inner = rig::inscribed_wall_eyed_array(rig, topology)) return inner->pose;
  rig::Pose pose;
  pose.position = rig.centre();
  pose.world_from_camera_rotation =
      Eigen::Quaterniond::FromTwoVectors(-Vector3d::UnitZ(), rig.mean_viewing_direction())
          .toRotationMatrix();
  return pose;
}

class CoveragePlanner {
 public:
  CoveragePlanner(const rig::Rig& rig, const CoverageOptions& options)
      : rig_(rig), options_(options), ideal_(rig::find_wall_eyed_array(rig)) {
    topology_ = complete_topology(rig);
    array_ = frame_of(rig, topology_);
    rotations_ = view_rotations(options, array_.world_from_camera_rotation);
    const Vector3d ahead = -array_.world_from_camera_rotation.col(2);
    plane_ = std::isinf(options.focal_depth_m)
                 ? Eigen::Vector4d(0, 0, 0, 1)
                 : Eigen::Vector4d(ahead.x(), ahead.y(), ahead.z(),
                                   -ahead.dot(array_.position) - options.focal_depth_m);
  }

  const rig::Pose& array() const { return array_; }

  CoverageVolume volume(double fov_deg, double share, const std::stop_token& stop) const {
    CoverageVolume volume;
    volume.view_fov_deg = fov_deg;
    volume.share = share;
    const render::VirtualCamera view = coverage_view(options_, fov_deg);
    if (ideal_ && share == 1) {
      volume.is_exact = true;
      volume.surface = exact_surface(view, volume.empty_because);
      return volume;
    }
    if (topology_.kind != rig::Topology::Kind::kTriangles) {
      volume.empty_because =
          "ranges of a row or of a single position are those of ideal cameras and all rays";
      return volume;
    }
    const auto has_share = [&](const Vector3d& position) {
      return has_recorded_share(view, position, share);
    };
    const std::optional<Vector3d> centre = find_centre(has_share);
    if (!centre) {
      volume.empty_because = why_empty(view, share);
      return volume;
    }
    RadialSurface found = radial_surface(has_share, *centre,
                                         {.reach = reach(view),
                                          .tolerance = options_.tolerance_m,
                                          .max_vertices = options_.max_vertices,
                                          .stop = stop});
    volume.empty_because = why_too_thin(found.surface, options_.tolerance_m, share, *centre);
    if (!volume.empty_because.empty()) return volume;
    volume.surface = std::move(found.surface);
    volume.error_m = found.error;
    return volume;
  }

  /// Returns the positions from which the subject is seen, up to as far behind the array as thrice
  /// its extent.
  CoverageVolume volume_of_subject(const CoverageSubject& subject) const {
    constexpr double kFarthest = 3;
    CoverageVolume volume;
    volume.is_of_subject = true;
    volume.is_exact = ideal_.has_value();
    volume.is_lower_bound = !volume.is_exact;
    const std::optional<rig::WallEyedArray> array =
        ideal_ ? ideal_ : rig::inscribed_wall_eyed_array(rig_, topology_, &volume.empty_because);
    if (!array) return volume;
    std::vector<Vector3d> corners;
    for (int corner = 0; corner < 8; ++corner) {
      const Vector3d side((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1,
                          (corner & 4) != 0 ? 1 : -1);
      corners.emplace_back(Vector3d(subject.x_m, subject.y_m, -subject.depth_m) +
                           subject.size_m / 2 * side);
    }
    const double farthest = std::max(1e-6, kFarthest * extent_of_array());
    const rig::RangeOfMotion range = rig::range_of_motion_around(*array, corners, farthest);
    volume.empty_because = range.empty_because;
    if (range.positions.is_empty()) return volume;
    volume.surface = surface_of(range.positions);
    const bool reaches_it = std::ranges::any_of(
        volume.surface.vertices,
        [&](const Vector3d& vertex) { return vertex.z() > farthest * (1 - 1e-9); });
    if (reaches_it) volume.cut_off_m = farthest;
    return volume;
  }

 private:
  /// Intersects the ranges of all orientations.
  ClosedSurface exact_surface(const render::VirtualCamera& view, std::string& empty_because) const {
    std::vector<rig::HalfSpace> half_spaces;
    double extent = 0;
    for (const Eigen::Matrix3d& rotation : rotations_) {
      const rig::ViewFrustum frustum{rig::camera_slopes(view.intrinsics, view.width, view.height),
                                     array_.world_from_camera_rotation * rotation,
                                     options_.interaxial_m};
      const rig::RangeOfMotion range = rig::range_of_motion(*ideal_, frustum);
      if (range.positions.is_empty()) {
        empty_because = range.empty_because;
        return {};
      }
      if (rotations_.size() == 1 || range.dimension < 3) return surface_of(range.positions);
      for (const rig::ConvexPolyhedron::Face& face : range.positions.faces()) {
        half_spaces.push_back(face.half_space);
      }
      for (const Vector3d& vertex : range.positions.vertices()) {
        extent = std::max(extent, vertex.cwiseAbs().maxCoeff());
      }
    }
    const rig::ConvexPolyhedron common(half_spaces, 2 * extent);
    if (common.is_empty()) empty_because = "no position has the views of all rotations";
    return surface_of(common);
  }

  /// Calls test(view) for the views of all orientations and eyes at a position in the array's
  /// frame, until one returns false; returns whether none did.
  template <class Test>
  bool all_views(render::VirtualCamera view, const Vector3d& position, const Test& test) const {
    const int eyes = options_.interaxial_m > 0 ? 2 : 1;
    for (const Eigen::Matrix3d& rotation : rotations_) {
      view.pose.world_from_camera_rotation = array_.world_from_camera_rotation * rotation;
      for (int eye = 0; eye < eyes; ++eye) {
        const double side = eyes == 1 ? 0 : (eye - 0.5) * options_.interaxial_m;
        view.pose.position =
            array_.world_from_camera(position) + side * view.pose.world_from_camera_rotation.col(0);
        if (!test(view)) return false;
      }
    }
    return true;
  }

  bool has_recorded_share(const render::VirtualCamera& view, const Vector3d& position,
                          double share) const {
    return all_views(view, position, [&](const render::VirtualCamera& eye) {
      return is_recorded(eye, rig_, topology_, plane_, share);
    });
  }

  /// States the share that was recorded in the array's middle.
  std::string why_empty(const render::VirtualCamera& view, double share) const {
    double recorded = 1;
    all_views(view, Vector3d::Zero(), [&](const render::VirtualCamera& eye) {
      recorded = std::min(recorded, 1 - unrecorded_share(eye, rig_, topology_, plane_));
      return true;
    });
    return fmt::format(
        "no position was found with {:.4g} % of the rays; in the array's middle "
        "{:.1f} % were recorded",
        100 * share, 100 * recorded);
  }

  /// Searches the array's middle and places along its axis for a position inside.
  template <class IsInside>
  std::optional<Vector3d> find_centre(const IsInside& is_inside) const {
    const double size = extent_of_array();
    for (const double depth : {0.0, 0.02, -0.02, 0.1, -0.1, 0.3, -0.3, 1.0, -1.0}) {
      const Vector3d position(0, 0, depth * size);
      if (is_inside(position)) return position;
    }
    return std::nullopt;
  }

  double extent_of_array() const {
    double extent = 0;
    for (const rig::Rig::Camera& camera : rig_.cameras) {
      extent = std::max(extent, (camera.pose.position - array_.position).norm());
    }
    return 2 * extent;
  }

  /// Returns how far from the array a view may be: where its outermost rays cross the array's ends.
  double reach(const render::VirtualCamera& view) const {
    const double half = view.width / 2.0 / view.intrinsics.fx;
    return std::max(1e-3, extent_of_array() * (1 + 1 / (half * 0.75)));
  }

  const rig::Rig& rig_;
  const CoverageOptions& options_;
  std::optional<rig::WallEyedArray> ideal_;
  rig::Topology topology_;
  rig::Pose array_;
  std::vector<Eigen::Matrix3d> rotations_;  // of the views, in the array's frame
  Eigen::Vector4d plane_;
};

}  // namespace

bool CoverageOptions::is_valid(std::string* reason) const {
  const auto refuse = [&](const char* why) {
    if (reason != nullptr) *reason = why;
    return false;
  };
  for (const double fov : view_fov_deg) {
    if (!(fov >= 0.01 && fov <= 179)) {
      return refuse("a field of view must be 0.01 to 179 degrees");
    }
  }
  for (const double share : shares) {
    if (!(share > 0 && share <= 1)) return refuse("a share must be above 0 and at most 100 %");
  }
  if (view_fov_deg.empty() || shares.empty()) return refuse("give a field of view and a share");
  if (!(aspect >= 0.01 && aspect <= 100)) return refuse("the aspect ratio must be 0.01 to 100");
  if (!(std::abs(yaw_deg) <= 180 && max_yaw_deg <= 180)) {
    return refuse("the views must turn by at most 180 degrees");
  }
  if (!(std::abs(pitch_deg) <= 90)) return refuse("the pitch must be at most 90 degrees");
  if (!(max_yaw_deg >= 0)) return refuse("the range of the yaw must not be negative");
  if (!(interaxial_m >= 0 && std::isfinite(interaxial_m))) {
    return refuse("the distance of the eyes must be 0 or more");
  }
  if (!(focal_depth_m > 0)) return refuse("the focal plane must be in front of the array");
  if (subject &&
      !(subject->size_m > 0 && std::isfinite(subject->size_m) && std::isfinite(subject->x_m) &&
        std::isfinite(subject->y_m) && std::isfinite(subject->depth_m))) {
    return refuse("the subject must have a size and a finite place");
  }
  if (max_vertices < 6) return refuse("a surface has at least 6 vertices");
  if (!(tolerance_m >= 1e-5)) return refuse("the tolerance must be at least 0.01 mm");
  return true;
}

bool CoverageOptions::has_views_back() const {
  return std::abs(yaw_deg) + max_yaw_deg >= 90 || std::abs(pitch_deg) >= 90;
}

Vector3d CoverageVolume::extent() const {
  if (surface.vertices.empty()) return Vector3d::Zero();
  Eigen::AlignedBox3d box;
  for (const Vector3d& vertex : surface.vertices) box.extend(vertex);
  return box.diagonal();
}

CoveragePlan plan_coverage(const std::string& name, const rig::Rig& rig,
                           const CoverageOptions& options,
                           const std::function<void(double)>& progress,
                           const std::stop_token& stop) {
  std::string reason;
  if (!options.is_valid(&reason)) throw Error::bad_input(reason, name, "Correct the views");
  if (rig.cameras.empty()) {
    throw Error::bad_input("the rig has no cameras", name, "Give a rig with cameras");
  }
  if (is_outward_array(rig)) return plan_outward_coverage(name, rig, options, progress, stop);
  if (options.has_views_back()) {
    throw Error::bad_input("views before an array in a plane must turn by less than 90 degrees",
                           name, "Correct the views");
  }
  if (options.subject && !(options.subject->depth_m > options.subject->size_m / 2)) {
    throw Error::bad_input("the subject must be in front of the array", name,
                           "Give a larger depth");
  }
  const CoveragePlanner planner(rig, options);
  CoveragePlan plan;
  plan.name = name;
  plan.options = options;
  plan.array = planner.array();
  for (const rig::Rig::Camera& camera : rig.cameras) {
    plan.cameras.push_back(plan.array.camera_from_world(camera.pose.position));
  }
  const std::vector<double> fovs = coverage_fovs(options);
  for (const double fov : fovs) {
    for (const double share : options.shares) {
      plan.volumes.push_back(planner.volume(fov, share, stop));
      if (progress) {
        progress(static_cast<double>(plan.volumes.size()) /
                 static_cast<double>(fovs.size() * options.shares.size()));
      }
      if (stop.stop_requested()) {
        throw Error::failed("the computation was stopped", name, "Start it again");
      }
    }
  }
  if (options.subject) plan.volumes.push_back(planner.volume_of_subject(*options.subject));
  return plan;
}

CoveragePlan plan_subject_coverage(const std::string& name, const rig::Rig& rig,
                                   const Vector3d& point, double size,
                                   const CoverageOptions& options, const std::stop_token& stop) {
  if (is_outward_array(rig)) {
    return plan_outward_subject_coverage(name, rig, point, size, options, stop);
  }
  CoveragePlan plan;
  plan.options = options;
  const CoveragePlanner planner(rig, plan.options);
  plan.name = name;
  plan.array = planner.array();
  const Vector3d middle = plan.array.camera_from_world(point);
  const CoverageSubject subject{middle.x(), middle.y(), -middle.z(), size};
  if (subject.depth_m > size / 2) {
    plan.volumes.push_back(planner.volume_of_subject(subject));
  } else {
    plan.volumes.emplace_back();
    plan.volumes.back().is_of_subject = true;
    plan.volumes.back().empty_because = "the subject is not in front of the array";
  }
  return plan;
}

}  // namespace raystage::planning
