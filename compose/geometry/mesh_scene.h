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

/// Whether rays that follow each other go alike, as a camera's do: Embree traces those faster. Hits
/// are the same.
enum class RayOrder { kAny, kAlike };

/// A mesh in Embree, to be placed anywhere. Thread-safe.
class MeshScene {
 public:
  /// `name`: of the mesh, for errors.
  MeshScene(Mesh mesh, std::string name);

  /// Builds Embree's tree, unless that is done: rays that come first do it, too, but make others
  /// wait. A mesh that no ray comes near needs none. Throws Error (failed) where Embree fails,
  /// std::bad_alloc where memory is short.
  void prepare() const;
  bool is_prepared() const { return is_prepared_.load(std::memory_order_acquire); }

  const Mesh& mesh() const { return mesh_; }

  /// Replaces hits by nearer ones. Rays are the world's, hits
  /// beyond `from_distance` of their origins count.
  void meet(const Eigen::Affine3d& object_from_world, std::span<const WorldRay> rays,
            double from_distance, std::span<SurfaceHit> hits,
            RayOrder order = RayOrder::kAny) const;

  /// Sets `blocked` to 1 for rays that meet the mesh anywhere between the distances; where it is 1
  /// already nobody looks.
  void block(const Eigen::Affine3d& object_from_world, std::span<const WorldRay> rays,
             double from_distance, double to_distance, std::span<std::uint8_t> blocked,
             RayOrder order = RayOrder::kAny) const;

  /// Middle of its bounds, coordinates of the file.
  const Eigen::Vector3d& centre() const { return centre_; }
  /// Half the diagonal of its bounds, units of the file.
  double radius() const { return radius_; }
  std::size_t bytes() const { return bytes_; }
  /// For benchmarks: Embree's own, in units of the file about the centre.
  RTCScene embree() const {
    prepare();
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
            double from_distance, std::span<const double> to_distance, Packet& packet) const;

  void build() const;

  Mesh mesh_;
  std::string name_;
  mutable std::once_flag prepared_;
  mutable std::atomic<bool> is_prepared_ = false;
  mutable Owned<RTCDevice> device_;
  mutable Owned<RTCScene> scene_;
  Eigen::Vector3d centre_;  ///< Embree's coordinates are float, from here on
  double radius_ = 0;
  std::size_t bytes_ = 0;
};

}  // namespace raystage
