// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <embree3/rtcore.h>

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <type_traits>

#include "render/common/world_ray.h"

namespace raystage::render {

class MeshProxy {
 public:
  /// Reads any format that Assimp reads (OBJ, PLY, glTF ...), in world coordinates and metres.
  /// Throws Error (bad input) if the file does not exist or has no triangle.
  explicit MeshProxy(const std::filesystem::path& file);

  /// Writes the inverse distances (1/m) of the first triangles hit, from either side; for rays
  /// without a hit, those of `beyond`.
  void intersect(std::span<const WorldRay> rays, std::span<double> inverse_distance,
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
  Eigen::Vector3d centre_;  ///< origin of Embree's coordinates, which are float
  double radius_ = 0;
  std::size_t bytes_ = 0;
};

}  // namespace raystage::render
