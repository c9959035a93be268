// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <embree3/rtcore.h>

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <type_traits>

#include "render/common/world_ray.h"

namespace raystage {

/// Triangles that stand for the scene, in Embree.
class MeshProxy {
 public:
  /// Any format that Assimp reads (OBJ, PLY, glTF ...); world, metres. Throws Error (bad input)
  /// where there is no such file, or no triangle in it.
  explicit MeshProxy(const std::filesystem::path& file);

  /// The first triangle hit, from either side; where there is none, what `beyond` says.
  void meet(std::span<const WorldRay> rays, std::span<double> inverse_distance,
            const RaySurface& beyond) const;

  std::size_t bytes() const { return bytes_; }

 private:
  struct Release {
    void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
    void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
    void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
  };
  template <typename Handle>
  using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Release>;

  Owned<RTCDevice> device_;
  Owned<RTCScene> scene_;
  Eigen::Vector3d centre_;  ///< Embree's coordinates are float, from here on
  double radius_ = 0;
  std::size_t bytes_ = 0;
};

}  // namespace raystage
