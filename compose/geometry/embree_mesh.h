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

namespace raystage::compose {

/// First intersection of a ray with a mesh, from either side.
struct SurfaceHit {
  static constexpr double kNone = std::numeric_limits<double>::infinity();
  double distance = kNone;  ///< along the ray, metres
  std::uint32_t triangle = 0;
  float u = 0, v = 0;  ///< barycentric coordinates of the triangle's second and third corner

  bool is_hit() const { return distance < kNone; }
};

/// Whether consecutive rays have similar directions, as those of a camera do: Embree traces these
/// faster. The hits are the same.
enum class RayCoherence { kIncoherent, kCoherent };

/// Traces rays against a mesh under any transform, with Embree. Thread-safe.
class EmbreeMesh {
 public:
  /// Stores the mesh. `name`: of the mesh, for errors.
  EmbreeMesh(Mesh mesh, std::string name);

  /// Builds Embree's BVH unless it exists. The first ray near the mesh does so, too, but blocks
  /// others. Throws Error (failed) if Embree fails, std::bad_alloc when memory runs out.
  void build_bvh() const;
  bool is_built() const { return is_built_.load(std::memory_order_acquire); }

  const Mesh& mesh() const { return mesh_; }

  /// Replaces `hits` by nearer ones. `rays`: world; `min_distance`: of hits on the ray, metres.
  void intersect(const Eigen::Affine3d& object_from_world, std::span<const render::WorldRay> rays,
                 double min_distance, std::span<SurfaceHit> hits,
                 RayCoherence order = RayCoherence::kIncoherent) const;

  /// Sets `occluded` to 1 for rays that intersect the mesh between the distances (metres, the
  /// larger of each ray). Rays whose value is already 1 are not traced.
  void occlude(const Eigen::Affine3d& object_from_world, std::span<const render::WorldRay> rays,
               double min_distance, std::span<const double> max_distance,
               std::span<std::uint8_t> occluded,
               RayCoherence order = RayCoherence::kIncoherent) const;

  /// Returns the centre of the bounding box, coordinates of the file.
  const Eigen::Vector3d& centre() const { return centre_; }
  /// Returns half the diagonal of the bounding box, units of the file.
  double radius() const { return radius_; }
  std::size_t bytes() const { return bytes_; }
  /// Returns Embree's scene, in units of the file, relative to centre(). For benchmarks.
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
  /// Rays in Embree's format. Each begins `start` units of the file from the origin of its world
  /// ray; a metre along it has `per_metre` units.
  struct Packet {
    alignas(64) RTCRayHit16 rays{};
    alignas(64) std::array<int, kPacket> valid{};
    std::array<double, kPacket> start{}, per_metre{};
  };
  /// Fills a packet with the parts of at most kPacket `rays` between the distances that pass near
  /// the mesh. Returns false if there are none.
  bool fill(const Eigen::Affine3d& object_from_world, std::span<const render::WorldRay> rays,
            double min_distance, std::span<const double> max_distance, Packet& packet) const;

  void build() const;

  Mesh mesh_;
  std::string name_;
  mutable std::once_flag built_;
  mutable std::atomic<bool> is_built_ = false;
  mutable Owned<RTCDevice> device_;
  mutable Owned<RTCScene> scene_;
  Eigen::Vector3d centre_;  ///< origin of Embree's coordinates, which are float
  double radius_ = 0;
  std::size_t bytes_ = 0;
};

}  // namespace raystage::compose
