// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "render/common/method.h"
#include "render/common/ray_cells.h"

namespace raystage::render {

/// A synthetic aperture: computes the weight of each camera of the array for a ray.
///
/// The ray crosses the array's surface (its cells, RayCells) at P. A camera at C has the weight
///   f = t^2 (3 - 2 t),  t = clamp((1 - q^2) / (1 - (1 - soft_edge)^2), 0, 1),  q = |P - C| / R,
/// with distances in the array's best-fit plane; |.| is round or a polygon's norm (R is then the
/// radius of the inscribed circle). In an array that looks outwards, distances are in the plane of
/// the cell that the ray crosses, and a camera's height h off this plane adds (h / R)^2 to q^2: the
/// distance in space, if round. So weights fall smoothly to 0 at the rim and are continuous
/// from ray to ray, also for views off the array. R is the aperture's radius, but at least the
/// largest distance from the camera to a neighbour, because a smaller aperture would contain no
/// camera between cameras. The smallest aperture is thus a smooth interpolation between neighbours.
class ApertureLens {
 public:
  struct Camera {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< from the array's centre, world axes, m
    double radius = 0;  ///< R, m; 0: never contributes; infinity: the only camera
  };
  /// The plane in which distances from crossings of a cell are measured.
  struct Plane {
    Eigen::Matrix<double, 2, 3> axes;                  ///< unit rows
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit; 0 where heights do not count
    double height = 0;                                 ///< of the cell along `normal`, m

    Eigen::Vector2d place_of(const Camera& camera) const { return axes * camera.position; }
    /// Returns (h / R)^2 of a camera.
    double relative_height_squared(const Camera& camera) const {
      const double relative = (normal.dot(camera.position) - height) / camera.radius;
      return relative * relative;
    }
  };

  /// Creates the lens that the options describe, focused on `focal_plane` as seen from `view`.
  /// Throws Error (bad input) where the options contradict each other.
  ApertureLens(const VirtualCamera& view, const LightFieldFrame& instant,
               const Eigen::Vector4d& focal_plane, const MethodOptions& options);

  /// Returns the cameras by index in the rig.
  const std::vector<Camera>& cameras() const { return cameras_; }
  /// Returns unit normals of the polygon's sides, one per pair of opposite sides; none if round.
  const std::vector<Eigen::Vector2d>& sides() const { return sides_; }
  /// Returns 1 / (1 - (1 - soft_edge)^2).
  double steepness() const { return steepness_; }

  /// Returns a note with the effective radius where the requested aperture is smaller than the
  /// array allows; otherwise empty.
  const std::string& note() const { return note_; }

  /// Returns the plane of a cell.
  Plane plane_of(const RayCells::Cell& cell) const;
  /// Returns where a ray crosses the cell's plane.
  Eigen::Vector2d place_of(const RayCells::Cell& cell, const Plane& plane,
                           const RayCells::Crossing& crossing) const;

  /// Returns f for a camera and a ray that crosses a cell's plane at `place`, 0 to 1.
  double weight(const Camera& camera, const Plane& plane, const Eigen::Vector2d& place) const;

 private:
  std::vector<Camera> cameras_;
  Plane array_plane_;
  bool outwards_ = false;
  Eigen::Vector3d up_ = Eigen::Vector3d::UnitY();  // Topology::up
  std::vector<Eigen::Vector2d> sides_;
  double steepness_ = 1;
  std::string note_;
};

/// Throws Error (bad input) where the options contradict each other.
void check_aperture_options(const MethodOptions& options);

/// Returns the radius in metres of the lens with a given f-number. The lens is on a film back
/// `film_width` mm wide with the view's field of view, focused at `focus_distance` m (may be
/// infinite). By the thin lens, 1 / focal length = 1 / image distance + 1 / focus distance; the
/// aperture's diameter is the focal length divided by the f-number.
double aperture_radius(const VirtualCamera& view, double f_number, double film_width,
                       double focus_distance);

/// Returns the plane perpendicular to the view's axis, `distance` m in front of the virtual camera.
Eigen::Vector4d view_parallel_plane(const VirtualCamera& view, double distance);

/// Returns all options of the method.
std::span<const OptionSpec> aperture_options();

}  // namespace raystage::render
