// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <embree3/rtcore.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "simulate/scene.h"

namespace raystage::simulate {

struct Ray {
  Eigen::Vector3f origin = Eigen::Vector3f::Zero();       ///< world, metres
  Eigen::Vector3f direction = -Eigen::Vector3f::UnitZ();  ///< unit
};

/// The first intersection of a ray.
struct Hit {
  float distance = std::numeric_limits<float>::infinity();  ///< metres along the ray
  int part = -1;                                            ///< index into Scene::parts
  int triangle = -1;
  float u = 0, v = 0;  ///< barycentric coordinates of the second and third corner
};

/// The data of a triangle for shading, in coordinates of its part.
struct TriangleShape {
  Eigen::Vector3f corner[3], normal[3];
  Eigen::Vector2f uv[3];
  Eigen::Vector3f gradient_u, gradient_v;  ///< of u and v, in the triangle's plane
  Eigen::Vector3f flat_normal;
  bool smooth = false;  ///< the corners' normals differ
};

/// A scene's triangles in Embree, shared by all worlds. Mirrors must be static.
class SceneGeometry {
 public:
  explicit SceneGeometry(const Scene& scene);

  const Scene& scene() const { return scene_; }
  const TriangleShape& triangle(int part, int index) const { return triangles_[part][index]; }

 private:
  friend class World;
  struct Release {
    void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
    void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
    void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
  };
  template <typename Handle>
  using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Release>;

  Owned<RTCScene> make_scene(std::span<const int> parts) const;

  const Scene& scene_;
  Owned<RTCDevice> device_;
  std::vector<int> static_;               ///< parts of static_scene_, by geometry id
  std::vector<std::vector<int>> moving_;  ///< groups of parts with one motion, by geometry id
  Owned<RTCScene> static_scene_;
  std::vector<Owned<RTCScene>> moving_scenes_;
  std::vector<std::vector<TriangleShape>> triangles_;  ///< per part
};

/// The scene at one time. Use one object per thread: setting the time takes microseconds. Tracing
/// is faster if successive rays are close to each other.
class World {
 public:
  explicit World(const SceneGeometry& geometry);

  const SceneGeometry& geometry() const { return geometry_; }
  void set_time(double seconds);
  /// Returns the transform of a part at the time set.
  const Eigen::Isometry3f& world_from_part(int part) const { return world_from_part_[part]; }

  /// Finds the first hit of each ray on a static part.
  void trace_static(std::span<const Ray> rays, std::span<Hit> hits) const;
  /// Finds the first hit of each ray on a moving part nearer than `limits`, metres along the ray.
  void trace_moving(std::span<const Ray> rays, std::span<const float> limits,
                    std::span<Hit> hits) const;
  /// Sets `occluded` to 1 where a static part is between a ray's origin and its limit. Skips rays
  /// whose entry is already set.
  void occlude_static(std::span<const Ray> rays, std::span<const float> limits,
                      std::span<std::uint8_t> occluded) const;
  /// Sets `occluded` in the same way for the moving parts.
  void occlude_moving(std::span<const Ray> rays, std::span<const float> limits,
                      std::span<std::uint8_t> occluded) const;

 private:
  const SceneGeometry& geometry_;
  SceneGeometry::Owned<RTCScene> moving_;                     ///< instances of the moving groups
  std::vector<SceneGeometry::Owned<RTCGeometry>> instances_;  ///< one per moving group
  std::vector<Eigen::Isometry3f> world_from_part_;
};

}  // namespace raystage::simulate
