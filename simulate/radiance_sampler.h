// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "simulate/world.h"

namespace raystage::simulate {

/// The light that a camera receives along a ray, and the surface that the ray shows.
struct LightSample {
  Eigen::Vector3f light = Eigen::Vector3f::Zero();  ///< linear, Rec.709 primaries; full scale 1
  /// Unit normal of the surface seen (behind a mirror: of the reflected one), world.
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();
  float distance = std::numeric_limits<float>::infinity();  ///< to the first surface, metres
  int part = -1;                                            ///< of the first surface; -1: none
  int reflected_part = -1;       ///< the surface that a mirror shows; -1: none
  float reflected_distance = 0;  ///< from the mirror to that surface, metres
  bool lit = false;              ///< the lamp illuminates the surface seen
};

/// The light along a ray without the moving parts, and the data to add them at any time.
struct StaticSample {
  Eigen::Vector3f unlit = Eigen::Vector3f::Zero();  ///< light without the lamp
  Eigen::Vector3f lamp = Eigen::Vector3f::Zero();   ///< light of the lamp; 0 in static shadow
  Ray shadow{};            ///< ray to the lamp; undefined where `lamp` is 0
  float shadow_limit = 0;  ///< distance of the lamp, metres
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();
  float distance = std::numeric_limits<float>::infinity();
  int part = -1;
  bool mirror = false;
  Ray reflected_ray{};  ///< from the mirror
  float reflected_distance = std::numeric_limits<float>::infinity();
  int reflected_part = -1;
};

/// Computes the light along rays through a world. Has scratch memory: use one object per thread.
class RadianceSampler {
 public:
  /// Traces the static parts. `footprint`: width of a sample at 1 m, metres.
  void sample_static(const World& world, std::span<const Ray> rays, float footprint,
                     std::span<StaticSample> samples);
  /// Adds the moving parts at the world's time. `still`: results of sample_static() for the rays.
  void sample(const World& world, std::span<const Ray> rays, float footprint,
              std::span<const StaticSample* const> still, std::span<LightSample> samples);

 private:
  /// A surface that the lamp illuminates if its shadow ray is free.
  struct PendingShadowRay {
    std::size_t sample = 0;
    Eigen::Vector3f lamp;  ///< the lamp's light on it
  };

  void reflect(const World& world, std::span<const Ray> rays, std::span<StaticSample> samples);
  void trace_reflections(const World& world, float footprint,
                         std::span<const StaticSample* const> still,
                         std::span<LightSample> samples);
  void add_moving_surface(const World& world, const Ray& ray, const Hit& hit, float travelled,
                          float footprint, const Eigen::Vector3f& tint, std::size_t index,
                          LightSample& sample);
  void queue_shadow_ray(const Scene& scene, std::size_t index, const Eigen::Vector3f& origin,
                        const Eigen::Vector3f& lamp);

  std::vector<Hit> hits_, reflected_hits_;
  std::vector<float> limits_, reflected_limits_;
  std::vector<Ray> reflected_rays_;
  std::vector<std::size_t> reflected_index_;
  std::vector<Ray> shadow_;
  std::vector<float> shadow_limits_;
  std::vector<std::uint8_t> occluded_;
  std::vector<PendingShadowRay> pending_shadow_rays_;
};

}  // namespace raystage::simulate
