// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <embree3/rtcore.h>

#include <Eigen/Geometry>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <type_traits>

#include "compose/geometry/mesh.h"
#include "render/common/world_ray.h"

namespace raystage {

/// Where a ray meets a mesh first, from either side.
struct SurfaceHit {
  static constexpr double kNone = std::numeric_limits<double>::infinity();
  double distance = kNone;  ///< along the ray, metres
  std::uint32_t triangle = 0;
  float u = 0, v = 0;  ///< barycentric: of the triangle's second and third corner

  bool is_hit() const { return distance < kNone; }
};

/// Whether rays that follow each other go alike, as a camera's do: Embree traces those faster. Hits
/// are the same.
enum class RayCoherence { kIncoherent, kCoherent };

/// A mesh in Embree, to be placed anywhere. Thread-safe.
class EmbreeMesh {
 public:
  /// `name`: of the mesh, for errors.
  EmbreeMesh(Mesh mesh, std::string name);

  /// Builds Embree's tree, unless that is done: rays that come first do it, too, but make others
  /// wait. A mesh that no ray comes near needs none. Throws Error (failed) where Embree fails,
  /// std::bad_alloc where memory is short.
  void build_bvh() const;
  bool is_built() const { return is_built_.load(std::memory_order_acquire); }

  const Mesh& mesh() const { return mesh_; }

  /// Replaces hits by nearer ones. Rays are the world's, hits
  /// beyond `min_distance` of their origins count.
  void intersect(const Eigen::Affine3d& object_from_world, std::span<const WorldRay> rays,
                 double min_distance, std::span<SurfaceHit> hits,
                 RayCoherence order = RayCoherence::kIncoherent) const;

  /// Sets `occluded` to 1 for rays that intersect the mesh anywhere between the distances; where it
  /// is 1 already nobody looks.
  void occlude(const Eigen::Affine3d& object_from_world, std::span<const WorldRay> rays,
               double min_distance, double max_distance, std::span<std::uint8_t> occluded,
               RayCoherence order = RayCoherence::kIncoherent) const;

  /// Middle of its bounds, coordinates of the file.
  const Eigen::Vector3d& centre() const { return centre_; }
  /// Half the diagonal of its bounds, units of the file.
  double radius() const { return radius_; }
  std::size_t bytes() const { return bytes_; }
  /// For benchmarks: Embree's own, in units of the file about the centre.
  RTCScene embree() const {
    build_bvh();
    return scene_.get();
  }

 private:
  struct Release {
    void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
    void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
    void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
  };
  template <typename Handle>
  using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Release>;

  static constexpr std::size_t kPacket = 16;
  /// Rays as Embree takes them, and how to read its answers: each begins `start` units of the file
  /// from its ray's origin, which has `per_metre` of them.
  struct Packet {
    alignas(64) RTCRayHit16 rays{};
    alignas(64) std::array<int, kPacket> valid{};
    std::array<double, kPacket> start{}, per_metre{};
  };
  /// Of `rays`, kPacket at most, the parts between the distances; false: none comes near the mesh.
  bool fill(const Eigen::Affine3d& object_from_world, std::span<const WorldRay> rays,
            double min_distance, std::span<const double> max_distance, Packet& packet) const;

  void build() const;

  Mesh mesh_;
  std::string name_;
  mutable std::once_flag built_;
  mutable std::atomic<bool> is_built_ = false;
  mutable Owned<RTCDevice> device_;
  mutable Owned<RTCScene> scene_;
  Eigen::Vector3d centre_;  ///< Embree's coordinates are float, from here on
  double radius_ = 0;
  std::size_t bytes_ = 0;
};

}  // namespace raystage
