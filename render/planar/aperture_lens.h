// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "render/common/method.h"
#include "rig/topology.h"

namespace raystage {

/// A synthetic aperture: how much of a ray's light each camera of the array gathers.
///
/// The ray crosses the array's surface (its cells, RayCells) at P. A camera at C counts with
///   f = t^2 (3 - 2 t),  t = clamp((1 - q^2) / (1 - (1 - soft_edge)^2), 0, 1),  q = |P - C| / R,
/// distances in the array's best-fit plane, |.| round or a polygon's norm (R is then the radius of
/// the circle within). Weights so fall smoothly to 0 at the rim and change smoothly from ray to
/// ray, also for views off the array. R is the aperture's radius, but at least the longest way to
/// one of the camera's neighbours: a light field has no rays between its cameras, and an aperture
/// smaller than their spacing would see nothing in between. So the smallest aperture is a smooth
/// interpolation between neighbours.
class ApertureLens {
 public:
  struct Camera {
    Eigen::Vector2d place = Eigen::Vector2d::Zero();  ///< in the array's plane, m
    double reach = 0;  ///< R, m; 0 for one that gathers nothing, infinity where there is one only
  };

  /// The lens that the options ask for, focused on `focal_plane` seen from `view`. Throws Error
  /// (bad input) where they contradict each other.
  ApertureLens(const VirtualCamera& view, const LightFieldFrame& instant,
               const Eigen::Vector4d& focal_plane, const MethodOptions& options);

  /// Per camera of the rig.
  const std::vector<Camera>& cameras() const { return cameras_; }
  /// Unit normals of the polygon's sides, one of each pair of opposite ones; none if round.
  const std::vector<Eigen::Vector2d>& sides() const { return sides_; }
  /// 1 / (1 - (1 - soft_edge)^2).
  double steepness() const { return steepness_; }

  /// Where the aperture asked for is smaller than the array can make: a line that says so, and how
  /// wide it is instead; else empty.
  const std::string& note() const { return note_; }

  /// f for a camera and a ray that crosses the array at `crossing`, 0 to 1.
  double weight(const Camera& camera, const Eigen::Vector2d& crossing) const;

 private:
  std::vector<Camera> cameras_;
  std::vector<Eigen::Vector2d> sides_;
  double steepness_ = 1;
  std::string note_;
};

/// Throws Error (bad input) where the options contradict each other.
void check_aperture_options(const MethodOptions& options);

/// Radius in metres of a lens that a photographer names by its f-number, on a film back
/// `film_width` mm wide with the view's field of view, focused `focus_distance` m away (may be
/// infinite): by the thin lens, 1 / focal length = 1 / image distance + 1 / focus distance; the
/// aperture's diameter is the focal length by the f-number.
double aperture_radius(const VirtualCamera& view, double f_number, double film_width,
                       double focus_distance);

/// The plane across the view's axis, `distance` m ahead of it.
Eigen::Vector4d view_parallel_plane(const VirtualCamera& view, double distance);

/// All options of the method.
std::span<const OptionSpec> aperture_options();

}  // namespace raystage
