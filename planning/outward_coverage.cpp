// SPDX-License-Identifier: Apache-2.0
// Computes from where a view can be rendered of an array that looks outwards. A position counts if
// the cameras recorded the share of the rays of every orientation and eye, or of all directions;
// the border of these positions is searched for along directions from one that counts. Of a ring
// only its plane is searched. Cost: some 40 evaluations of recorded rays a vertex, each that of one
// picture, or of the six sides of a cube.
#include "planning/outward_coverage.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "planning/combined_coverage.h"
#include "planning/complete_topology.h"
#include "planning/coverage_views.h"
#include "planning/recorded_directions.h"
#include "planning/recorded_rays.h"
#include "rig/topology.h"

namespace raystage::planning {
namespace {

using Eigen::Vector3d;

constexpr double kRadianPerDegree = std::numbers::pi / 180;

/// Returns whether cameras are the side of a box: three or more that face alike or inwards.
bool is_flat_side(const rig::Rig& side) {
  constexpr double kSpread = 5 * kRadianPerDegree;  // of directions; mounts are more precise
  if (side.cameras.size() < 3) return false;
  const Vector3d middle = side.centre(), mean = side.mean_viewing_direction();
  double spread = 0, outwards = 0;
  for (const rig::Rig::Camera& camera : side.cameras) {
    const Vector3d turned = camera.pose.viewing_direction() - mean;
    const Vector3d offset = camera.pose.position - middle;
    spread += turned.squaredNorm();
    if (offset.norm() > 0) outwards += turned.dot(offset.normalized());
  }
  const auto count = static_cast<double>(side.cameras.size());
  return std::sqrt(spread / count) < kSpread || outwards <= 0;
}

/// Returns a flat polygon around `centre` as a closed surface of no volume.
ClosedSurface flat_surface(const Vector3d& centre, std::vector<Vector3d> outline) {
  ClosedSurface surface;
  const int count = static_cast<int>(outline.size());
  surface.vertices = std::move(outline);
  surface.vertices.push_back(centre);
  for (int i = 0; i < count; ++i) {
    const int next = (i + 1) % count;
    surface.triangles.push_back({count, i, next});
    surface.triangles.push_back({count, next, i});
  }
  return surface;
}

/// Returns the rotation of a camera without roll that looks along a direction of the world.
Eigen::Matrix3d level_rotation(const Vector3d& ahead) {
  constexpr double kVertical = 1e-6;
  const Vector3d right = ahead.cross(Vector3d::UnitY());
  if (right.norm() < kVertical) {
    return Eigen::Quaterniond::FromTwoVectors(-Vector3d::UnitZ(), ahead).toRotationMatrix();
  }
  Eigen::Matrix3d rotation;
  rotation.col(0) = right.normalized();
  rotation.col(1) = rotation.col(0).cross(ahead);
  rotation.col(2) = -ahead;
  return rotation;
}

class OutwardPlanner {
 public:
  OutwardPlanner(const rig::Rig& rig, const CoverageOptions& options, const std::stop_token& stop)
      : rig_(rig),
        options_(options),
        stop_(stop),
        topology_(complete_topology(rig)),
        frame_(outward_frame(rig, topology_)),
        is_ring_(topology_.kind == rig::Topology::Kind::kSegments) {
    for (const rig::Rig::Camera& camera : rig.cameras) {
      extent_ = std::max(extent_, 2 * (camera.pose.position - frame_.position).norm());
    }
    constexpr double kStepDegrees = 5;  // between orientations
    rotations_ = view_rotations(options, frame_.world_from_camera_rotation, kStepDegrees);
  }

  const rig::Pose& frame() const { return frame_; }

  CoverageVolume volume(double fov_deg, double share) const {
    CoverageVolume volume;
    volume.view_fov_deg = fov_deg;
    volume.share = share;
    if (is_ring_ && !stays_in_plane()) {
      volume.empty_because = "a ring has no rays of views that look out of its plane";
      return volume;
    }
    render::VirtualCamera view = coverage_view(options_, fov_deg);
    if (is_ring_) {  // one row of pixels
      view.intrinsics.cy += 0.5 - view.height / 2.0;
      view.height = 1;
    }
    const auto has_share = [&](const Vector3d& position) {
      return !stop_.stop_requested() && has_recorded_share(view, position, share);
    };
    const double half = view.width / 2.0 / view.intrinsics.fx;
    const double reach =
        std::max(1e-3, extent_ * (options_.all_directions ? 1 : 1 + 1 / (half * 0.75)));
    search(has_share, reach, volume);
    if (volume.surface.vertices.empty() && volume.empty_because.empty()) {
      volume.empty_because = fmt::format(
          "no position was found with {:.4g} % of the rays; in the array's middle {:.1f} % were "
          "recorded",
          100 * share, 100 * recorded_share_in_middle(view));
    }
    return volume;
  }

  /// Returns the positions from which the subject is seen, as far from the first one that is found
  /// as three times the array's extent.
  CoverageVolume volume_of_subject(const CoverageSubject& subject) const {
    constexpr double kFarthest = 3;
    CoverageVolume volume;
    volume.is_of_subject = true;
    if (is_ring_) {
      volume.empty_because = "a ring has the rays to a subject from its own plane only";
      return volume;
    }
    std::vector<Vector3d> corners;
    for (int corner = 0; corner < 8; ++corner) {
      const Vector3d side((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1,
                          (corner & 4) != 0 ? 1 : -1);
      corners.push_back(frame_.world_from_camera(
          Vector3d(subject.x_m, subject.y_m, -subject.depth_m) + subject.size_m / 2 * side));
    }
    const double reach = std::max(1e-6, kFarthest * extent_);
    const auto centre = search(
        [&](const Vector3d& position) {
          return !stop_.stop_requested() &&
                 is_body_recorded(frame_.world_from_camera(position), corners, rig_, topology_);
        },
        reach, volume);
    if (volume.surface.vertices.empty() && volume.empty_because.empty()) {
      volume.empty_because = "no position was found from which every ray to it was recorded";
    }
    const bool reaches_end =
        std::ranges::any_of(volume.surface.vertices, [&](const Vector3d& vertex) {
          return (vertex - *centre).norm() > reach * (1 - 1e-3) - volume.error_m;
        });
    if (reaches_end) volume.cut_off_m = reach;
    return volume;
  }

 private:
  /// Searches a volume around the first of some positions that is inside, and returns that one.
  /// Leaves the surface empty where none is.
  template <class IsInside>
  std::optional<Vector3d> search(const IsInside& is_inside, double reach,
                                 CoverageVolume& volume) const {
    const std::vector<Vector3d> positions = candidates();
    const auto centre = std::ranges::find_if(positions, is_inside);
    if (centre == positions.end()) return std::nullopt;
    if (is_ring_) {
      search_plane(is_inside, *centre, reach, volume);
      return *centre;
    }
    RadialSurface found = radial_surface(is_inside, *centre,
                                         {.reach = reach,
                                          .tolerance = options_.tolerance_m,
                                          .max_vertices = options_.max_vertices,
                                          .stop = stop_});
    volume.empty_because = why_too_thin(found.surface, options_.tolerance_m, volume.share, *centre);
    if (!volume.empty_because.empty()) return *centre;
    volume.surface = std::move(found.surface);
    volume.error_m = found.error;
    return *centre;
  }

  /// Searches the ring's plane, where y is 0.
  template <class IsInside>
  void search_plane(const IsInside& is_inside, const Vector3d& centre, double reach,
                    CoverageVolume& volume) const {
    constexpr int kDirections = 720, kSteps = 200;
    std::vector<Vector3d> outline(kDirections);
    raystage::parallel_for(0, kDirections, [&](int i) {
      const double turn = -2 * std::numbers::pi * i / kDirections;
      const Vector3d direction(std::cos(turn), 0, std::sin(turn));
      double inside = 0, outside = reach;
      for (int step = 1; step <= kSteps; ++step) {
        const double at = reach * step / kSteps;
        if (!is_inside(centre + at * direction)) {
          outside = at;
          break;
        }
        inside = at;
      }
      while (outside - inside > options_.tolerance_m / 8) {
        const double middle = (inside + outside) / 2;
        (is_inside(centre + middle * direction) ? inside : outside) = middle;
      }
      outline[static_cast<std::size_t>(i)] = centre + inside * direction;
    });
    for (int i = 0; i < kDirections; ++i) {  // how far every point is from its neighbours' line
      const Vector3d& before =
          outline[static_cast<std::size_t>((i + kDirections - 1) % kDirections)];
      const Vector3d& after = outline[static_cast<std::size_t>((i + 1) % kDirections)];
      const Vector3d along = (after - before).normalized();
      const Vector3d off = outline[static_cast<std::size_t>(i)] - before;
      volume.error_m = std::max(volume.error_m, (off - off.dot(along) * along).norm() / 4);
    }
    volume.error_m += options_.tolerance_m / 8;
    volume.surface = flat_surface(centre, std::move(outline));
  }

  bool stays_in_plane() const {
    constexpr double kLevel = 1e-3;  // radians
    return options_.all_directions ||
           std::ranges::all_of(rotations_, [](const Eigen::Matrix3d& rotation) {
             return std::abs(rotation(1, 2)) < kLevel && std::abs(rotation(1, 0)) < kLevel;
           });
  }

  bool has_recorded_share(const render::VirtualCamera& view, const Vector3d& position,
                          double share) const {
    if (options_.all_directions) {
      return are_directions_recorded({frame_.world_from_camera(position), options_.focal_depth_m},
                                     rig_, topology_, share);
    }
    return all_views(view, position, [&](const render::VirtualCamera& eye) {
      return is_recorded(eye, rig_, topology_, plane_of(eye), share);
    });
  }

  double recorded_share_in_middle(const render::VirtualCamera& view) const {
    if (options_.all_directions) {
      return 1 - unrecorded_directions({frame_.position, options_.focal_depth_m}, rig_, topology_);
    }
    double recorded = 1;
    all_views(view, Vector3d::Zero(), [&](const render::VirtualCamera& eye) {
      recorded = std::min(recorded, 1 - unrecorded_share(eye, rig_, topology_, plane_of(eye)));
      return true;
    });
    return recorded;
  }

  Eigen::Vector4d plane_of(const render::VirtualCamera& view) const {
    return rig::fronto_parallel_plane(rig_, options_.focal_depth_m, view.pose.viewing_direction());
  }

  /// Calls test(view) for the views of all orientations and eyes, until one returns false; returns
  /// whether none did.
  template <class Test>
  bool all_views(render::VirtualCamera view, const Vector3d& position, const Test& test) const {
    const int eyes = options_.interaxial_m > 0 ? 2 : 1;
    for (const Eigen::Matrix3d& rotation : rotations_) {
      view.pose.world_from_camera_rotation = frame_.world_from_camera_rotation * rotation;
      for (int eye = 0; eye < eyes; ++eye) {
        const double side = eyes == 1 ? 0 : (eye - 0.5) * options_.interaxial_m;
        view.pose.position =
            frame_.world_from_camera(position) + side * view.pose.world_from_camera_rotation.col(0);
        if (!test(view)) return false;
      }
    }
    return true;
  }

  /// Returns positions from the middle outwards: along the frame's axes and diagonals, of a ring in
  /// its plane.
  std::vector<Vector3d> candidates() const {
    std::vector<Vector3d> positions{Vector3d::Zero()};
    for (const double distance : {0.05, 0.15, 0.3, 0.5, 1.0, 2.0}) {
      for (int x = -1; x <= 1; ++x) {
        for (int y = is_ring_ ? 0 : -1; y <= (is_ring_ ? 0 : 1); ++y) {
          for (int z = -1; z <= 1; ++z) {
            if (x == 0 && y == 0 && z == 0) continue;
            positions.push_back(distance * extent_ * Vector3d(x, y, z).normalized());
          }
        }
      }
    }
    return positions;
  }

  const rig::Rig& rig_;
  const CoverageOptions& options_;
  std::stop_token stop_;
  rig::Topology topology_;
  rig::Pose frame_;
  bool is_ring_ = false;
  double extent_ = 0;
  std::vector<Eigen::Matrix3d> rotations_;  // of the views, in the frame
};

void throw_if_requested(const std::stop_token& stop, const std::string& name) {
  if (!stop.stop_requested()) return;
  throw Error::failed("the computation was stopped", name, "Start it again");
}

CoveragePlan started_plan(const std::string& name, const rig::Rig& rig,
                          const OutwardPlanner& planner) {
  CoveragePlan plan;
  plan.name = name;
  plan.looks_around = true;
  plan.array = planner.frame();
  for (const rig::Rig::Camera& camera : rig.cameras) {
    plan.cameras.push_back(plan.array.camera_from_world(camera.pose.position));
  }
  return plan;
}

}  // namespace

bool is_outward_array(const rig::Rig& rig) {
  if (rig.cameras.size() < 3 || !complete_topology(rig).outwards) return false;
  const bool has_fisheyes = std::ranges::any_of(rig.cameras, [](const rig::Rig::Camera& camera) {
    return camera.model.fisheye() != nullptr;
  });
  return has_fisheyes ||
         !std::ranges::all_of(split_into_sides({"", rig}),
                              [](const NamedRig& side) { return is_flat_side(side.rig); });
}

rig::Pose outward_frame(const rig::Rig& rig, const rig::Topology& topology) {
  constexpr double kAlike = 0.1;  // the length of the mean direction
  Vector3d sum = Vector3d::Zero();
  for (const rig::Rig::Camera& camera : rig.cameras) sum += camera.pose.viewing_direction();
  const bool has_direction = sum.norm() > kAlike * static_cast<double>(rig.cameras.size());
  rig::Pose frame;
  frame.position = rig.centre();
  if (topology.kind != rig::Topology::Kind::kSegments) {
    if (has_direction) frame.world_from_camera_rotation = level_rotation(sum.normalized());
    return frame;
  }
  const Vector3d up = topology.up.y() < 0 ? Vector3d(-topology.up) : topology.up;
  Vector3d ahead = has_direction ? sum : Vector3d(-Vector3d::UnitZ());
  ahead -= ahead.dot(up) * up;
  if (ahead.norm() < kAlike) ahead = up.unitOrthogonal();  // a level ring has -z in its plane
  const Vector3d back = -ahead.normalized();
  frame.world_from_camera_rotation.col(0) = up.cross(back);
  frame.world_from_camera_rotation.col(1) = up;
  frame.world_from_camera_rotation.col(2) = back;
  return frame;
}

CoveragePlan plan_outward_coverage(const std::string& name, const rig::Rig& rig,
                                   const CoverageOptions& options,
                                   const std::function<void(double)>& progress,
                                   const std::stop_token& stop) {
  if (options.all_directions && options.interaxial_m > 0) {
    throw Error::bad_input("views of all directions have one eye", name, "Correct the views");
  }
  const OutwardPlanner planner(rig, options, stop);
  CoveragePlan plan = started_plan(name, rig, planner);
  plan.options = options;
  const std::vector<double> fovs = coverage_fovs(options);
  const std::size_t count = fovs.size() * options.shares.size() + (options.subject ? 1 : 0);
  const auto add = [&](CoverageVolume volume) {
    throw_if_requested(stop, name);
    plan.volumes.push_back(std::move(volume));
    if (progress) {
      progress(static_cast<double>(plan.volumes.size()) / static_cast<double>(count));
    }
  };
  for (const double fov : fovs) {
    for (const double share : options.shares) add(planner.volume(fov, share));
  }
  if (options.subject) add(planner.volume_of_subject(*options.subject));
  return plan;
}

CoveragePlan plan_outward_subject_coverage(const std::string& name, const rig::Rig& rig,
                                           const Vector3d& point, double size,
                                           const CoverageOptions& options,
                                           const std::stop_token& stop) {
  const OutwardPlanner planner(rig, options, stop);
  CoveragePlan plan = started_plan(name, rig, planner);
  plan.options = options;
  const Vector3d middle = plan.array.camera_from_world(point);
  plan.volumes.push_back(planner.volume_of_subject({middle.x(), middle.y(), -middle.z(), size}));
  throw_if_requested(stop, name);
  return plan;
}

}  // namespace raystage::planning
