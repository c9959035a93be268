// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "planning/radial_surface.h"
#include "render/common/view.h"
#include "rig/rig.h"

namespace raystage::planning {

/// What views must see: a cube that is parallel to the array. Of several arrays, the first one's
/// axes count, and the middle of all cameras.
struct CoverageSubject {
  double x_m = 0, y_m = 0;  ///< of its middle, to the right and upwards from the array's middle
  double depth_m = 0;       ///< of its middle, in front of the array
  double size_m = 0;        ///< of its edges
};

/// The views whose range of motion is computed. Angles in degrees, distances in metres.
struct CoverageOptions {
  std::vector<double> view_fov_deg = {30, 45, 60};  ///< horizontal, of each family member
  double aspect = 4.0 / 3;                          ///< width / height of the picture
  double yaw_deg = 0, pitch_deg = 0;  ///< of the views against the array: to the left, upwards
  double max_yaw_deg = 0;             ///< the views turn by up to that to both sides of their yaw
  bool all_directions = false;        ///< views of all directions, whatever the members above say
  double interaxial_m = 0;            ///< between the eyes of a stereo camera; 0: one eye
  /// Of the focal plane in front of the array; infinite: every ray as far as the horizon.
  double focal_depth_m = std::numeric_limits<double>::infinity();
  /// A view in place of those above, wherever it is: its orientation and lens.
  std::optional<render::VirtualCamera> view = {};
  std::vector<double> shares = {1, 0.99, 0.9};  ///< of the rays that must have been recorded
  std::optional<CoverageSubject> subject = {};  ///< adds the range of views of that alone
  double tolerance_m = 1e-3;                    ///< of volumes that are not exact
  int max_vertices = 4000;                      ///< of them
  /// Of several arrays: one does not see through another, as where all are there at a time.
  bool arrays_hide_each_other = true;

  /// Returns whether the options are in range; otherwise `reason` says what is not.
  bool is_valid(std::string* reason) const;
  /// Returns whether a view looks back, at 90 degrees or more from the array's direction.
  bool has_views_back() const;
};

/// The positions from which a share of a view's rays was recorded, in the array's frame.
struct CoverageVolume {
  double view_fov_deg = 0;
  double share = 1;
  /// The positions from which every ray to the subject was recorded (thesis 5.4), not those to the
  /// other parts of a view; field of view and share have no meaning then.
  bool is_of_subject = false;
  bool is_exact = false;        ///< a polyhedron in closed form (thesis 5.2)
  bool is_lower_bound = false;  ///< that of an ideal array whose rays the cameras recorded

  /// Metres beyond which nothing was looked for, although the range goes on: behind the array (+z),
  /// of one that looks outwards from a place within the range. That of a subject may have no end.
  std::optional<double> cut_off_m = {};
  bool is_in_parts = false;   ///< there are positions apart from the surface, which has one part
  double error_m = 0;         ///< of the surface, if it is not exact
  ClosedSurface surface;      ///< empty: there is no position
  std::string empty_because;  ///< why, for people

  Eigen::Vector3d extent() const;  ///< of the bounding box, metres
};

/// One of several arrays.
struct CoverageArray {
  std::string name;
  int cameras = 0;
  bool is_ideal = false;  ///< otherwise it counts with the rays that its cameras see as they are
  Eigen::Vector2d size_m = Eigen::Vector2d::Zero();   ///< between its outermost cameras
  Eigen::Vector2d fov_deg = Eigen::Vector2d::Zero();  ///< that all of its cameras see
};

/// From where several arrays see the middle of a subject.
struct CoverageSubjectView {
  double share_of_directions = 0;  ///< of the whole sphere
  int arrays = 0;                  ///< that see it
};

/// The ranges of motion before an array (thesis 5.1, 5.2 and 7.2), or of several ones (6.2). In the
/// array's frame its cameras look along -z.
struct CoveragePlan {
  std::string name;  ///< of the rig
  CoverageOptions options;
  bool looks_around = false;             ///< an array that looks outwards: see outward_coverage.h
  rig::Pose array;                       ///< of its frame in the world
  std::vector<Eigen::Vector3d> cameras;  ///< centres in the array's frame
  std::vector<CoverageVolume> volumes;   ///< by field of view, then by share
  std::vector<CoverageArray> arrays;     ///< empty for a single one
  std::optional<CoverageSubjectView> subject_view;  ///< of several arrays
};

/// Computes the ranges. Those of ideal arrays for all rays are exact; others are measured by the
/// rays that the cameras' frusta contain, with lens distortion. Arrays that look outwards are
/// planned by plan_outward_coverage(). Throws Error (bad input) for invalid options, a rig without
/// cameras, or views of all directions of another array, and Error (failed) if stopped.
/// `progress`: called with the share of the ranges that are done.
CoveragePlan plan_coverage(const std::string& name, const rig::Rig& rig,
                           const CoverageOptions& options,
                           const std::function<void(double)>& progress = {},
                           const std::stop_token& stop = {});

/// Computes the range of a subject alone: a cube around `point` (world, metres) with edges of
/// `size` metres. It is empty if the subject is not in front of the array. Takes milliseconds; for
/// arrays that look outwards seconds, by the tolerance and the vertices of the options. Throws
/// Error (failed) if stopped.
CoveragePlan plan_subject_coverage(const std::string& name, const rig::Rig& rig,
                                   const Eigen::Vector3d& point, double size,
                                   const CoverageOptions& options = {},
                                   const std::stop_token& stop = {});

}  // namespace raystage::planning
