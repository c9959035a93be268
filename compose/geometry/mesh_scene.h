// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <embree3/rtcore.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <type_traits>

#include "compose/geometry/mesh.h"
#include "render/view/world_ray.h"

namespace raystage {

/// Where a ray meets a mesh first, from either side.
struct SurfaceHit {
  static constexpr double kNone = std::numeric_limits<double>::infinity();
  double distance = kNone;  ///< along the ray, metres
  std::uint32_t triangle = 0;
  float u = 0, v = 0;  ///< barycentric: of the triangle's second and third corner

  bool is_hit() const { return distance < kNone; }
};

/// A mesh in Embree, to be placed anywhere. Thread-safe.
class MeshScene {
 public:
  /// `name`: of the mesh, for errors. Throws Error (failed) where memory is short.
  MeshScene(Mesh mesh, const std::string& name);

  const Mesh& mesh() const { return mesh_; }

  /// Replaces hits by nearer ones, and returns whether there are any. Rays are the world's, hits
  /// beyond `from_distance` of their origins count.
  void meet(const Eigen::Affine3d& object_from_world, std::span<const WorldRay> rays,
            double from_distance, std::span<SurfaceHit> hits) const;

  /// Middle of its bounds, coordinates of the file.
  const Eigen::Vector3d& centre() const { return centre_; }
  /// Half the diagonal of its bounds, units of the file.
  double radius() const { return radius_; }
  std::size_t bytes() const { return bytes_; }

 private:
  struct Release {
    void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
    void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
    void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
  };
  template <typename Handle>
  using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Release>;

  Mesh mesh_;
  Owned<RTCDevice> device_;
  Owned<RTCScene> scene_;
  Eigen::Vector3d centre_;  ///< Embree's coordinates are float, from here on
  double radius_ = 0;
  std::size_t bytes_ = 0;
};

}  // namespace raystage
