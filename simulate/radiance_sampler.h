// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "simulate/world.h"

namespace raystage {

/// The light that a camera receives along a ray, and the surface seen.
struct LightSample {
  Eigen::Vector3f light = Eigen::Vector3f::Zero();  ///< linear, Rec.709 primaries; full scale 1
  /// Of the surface seen (in the mirror, if there is one), towards the ray; world.
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();
  float distance = std::numeric_limits<float>::infinity();  ///< along the ray to the first surface
  int part = -1;                                            ///< first surface; -1: none
  int reflected_part = -1;       ///< surface seen in it where it is a mirror
  float reflected_distance = 0;  ///< from the mirror to that
  bool lit = false;              ///< the light reaches the surface seen
};

/// What a ray would bring back if nothing moved, and what is needed to put in what moves: a camera
/// that stands still works this out once for all its frames.
struct StaticSample {
  Eigen::Vector3f unlit = Eigen::Vector3f::Zero();  ///< light without the lamp's own
  Eigen::Vector3f lamp = Eigen::Vector3f::Zero();   ///< what the lamp adds; 0 in still shadow
  Ray shadow{};            ///< to the lamp; of no meaning where `lamp` is 0
  float shadow_limit = 0;  ///< how far that is, metres
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();
  float distance = std::numeric_limits<float>::infinity();
  int part = -1;
  bool mirror = false;
  Ray reflected_ray{};  ///< from the mirror
  float reflected_distance = std::numeric_limits<float>::infinity();
  int reflected_part = -1;
};

/// Computes the light along rays through a world. Keeps scratch memory: use one per thread.
class RadianceSampler {
 public:
  /// `footprint`: width of a sample at 1 m, metres.
  void sample_static(const World& world, std::span<const Ray> rays, float footprint,
                     std::span<StaticSample> samples);
  /// At the world's time. `still`: what sample_static() found for the same rays.
  void sample(const World& world, std::span<const Ray> rays, float footprint,
              std::span<const StaticSample* const> still, std::span<LightSample> samples);

 private:
  /// A surface that the lamp may light, waiting for its shadow ray.
  struct PendingShadowRay {
    std::size_t sample = 0;
    Eigen::Vector3f lamp;  ///< what it then adds
  };

  void reflect(const World& world, std::span<const Ray> rays, std::span<StaticSample> samples);
  void trace_reflections(const World& world, float footprint,
                         std::span<const StaticSample* const> still,
                         std::span<LightSample> samples);
  void add_moving_surface(const World& world, const Ray& ray, const Hit& hit, float travelled,
                          float footprint, const Eigen::Vector3f& tint, std::size_t index,
                          LightSample& sample);
  /// Puts a shadow ray from `origin` in the queue.
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

}  // namespace raystage
