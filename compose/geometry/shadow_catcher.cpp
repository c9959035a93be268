// SPDX-License-Identifier: Apache-2.0
// Casts shadows of meshes on a light field, whose surface is its depth image. Per pixel: `rays`
// directions over the sphere for ambient occlusion within `reach` (metres), and one shadow ray per
// directional light, traced with Embree. Colours of a premultiplied image with depth (metres) are
// multiplied by the share of light that arrives. Cost: pixels x rays x meshes.
#include "compose/geometry/shadow_catcher.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/parallel.h"
#include "compose/geometry/bsdf_sampling.h"

namespace raystage::compose {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

/// Start of rays from the surface as a share of its depth: the accuracy of reconstructed depths.
constexpr double kRelativeRayOffset = 1e-3;

/// Returns a direction of the unit sphere, uniformly for `at` in [0, 1)^2.
Vector3d direction_at(const std::array<double, 2>& at) {
  const double up = 1 - 2 * at[0], around = 2 * std::numbers::pi * at[1];
  const double out = std::sqrt(std::max(0.0, 1 - up * up));
  return {out * std::cos(around), up, out * std::sin(around)};
}

class Catcher {
 public:
  Catcher(const GeometryScene& scene, const ShadowCatcher& settings)
      : scene_(scene), settings_(settings), light_(scene.lights.ambient) {
    for (const DirectionalLight& light : scene.lights.directional) light_ += light.color;
    for (const MeshInstance& mesh : scene.meshes) {
      const double scale = mesh.world_from_object.linear().colwise().norm().maxCoeff();
      centres_.emplace_back(mesh.world_from_object * mesh.scene->centre());
      radii_.push_back(scale * mesh.scene->radius());
    }
  }

  /// Returns the share of all light that arrives at a point, R, G, B. `seed`: of its pixel.
  Vector3f arriving_share(const Vector3d& point, double min_distance, std::uint32_t seed) {
    const float hidden = ambient_occlusion(point, min_distance, seed);
    Vector3f taken = hidden * scene_.lights.ambient;
    for (const DirectionalLight& light : scene_.lights.directional) {
      if (light.casts_shadows && is_occluded(point, light.towards, min_distance)) {
        taken += light.color;
      }
    }
    Vector3f share = Vector3f::Ones();
    for (Eigen::Index c = 0; c < 3; ++c) {
      // Without lights, all light is assumed to be ambient.
      share(c) -= light_(c) > 0 ? taken(c) / light_(c) : hidden;
    }
    return share;
  }

 private:
  float ambient_occlusion(const Vector3d& point, double min_distance, std::uint32_t seed) {
    if (settings_.rays <= 0) return 0;
    const bool is_near = [&] {
      for (std::size_t m = 0; m < centres_.size(); ++m) {
        if ((centres_[m] - point).norm() < radii_[m] + settings_.reach) return true;
      }
      return false;
    }();
    if (!is_near) return 0;
    rays_.clear();
    for (int i = 0; i < settings_.rays; ++i) {
      rays_.push_back({point, direction_at(r2_sample(seed, static_cast<std::uint32_t>(i)))});
    }
    return std::min(1.0F, 2 * static_cast<float>(count_hits(min_distance, settings_.reach)) /
                              static_cast<float>(settings_.rays));
  }

  bool is_occluded(const Vector3d& point, const Vector3d& towards, double min_distance) {
    rays_.assign(1, {point, towards});
    return count_hits(min_distance, SurfaceHit::kNone) > 0;
  }

  /// Returns the number of rays that hit a mesh before `reach`.
  std::ptrdiff_t count_hits(double min_distance, double reach) {
    blocked_.assign(rays_.size(), 0);
    for (const MeshInstance& mesh : scene_.meshes) {
      mesh.scene->occlude(mesh.object_from_world, rays_, min_distance, reach, blocked_);
    }
    return std::ranges::count(blocked_, 1);
  }

  const GeometryScene& scene_;
  const ShadowCatcher& settings_;
  Vector3f light_;  ///< sum of all lights
  std::vector<Vector3d> centres_;
  std::vector<double> radii_;
  std::vector<render::WorldRay> rays_;
  std::vector<std::uint8_t> blocked_;
};

}  // namespace

void apply_shadow_catcher(const GeometryScene& scene, const render::VirtualCamera& camera,
                          const ShadowCatcher& settings, LayerImage& image) {
  if (scene.meshes.empty() || settings.strength <= 0) return;
  const schemas::Intrinsics& k = camera.intrinsics;
  parallel_for(tbb::blocked_range<int>(0, image.height), [&](const tbb::blocked_range<int>& rows) {
    Catcher catcher(scene, settings);
    for (int y = rows.begin(); y < rows.end(); ++y) {
      for (int x = 0; x < image.width; ++x) {
        const std::size_t pixel = static_cast<std::size_t>(y) * image.width + x;
        const double z = double{image.z[pixel]};
        if (!std::isfinite(z) || image.rgba[4 * pixel + 3] <= 0) continue;
        const Vector3d ray((x + 0.5 - k.cx) / k.fx, -(y + 0.5 - k.cy) / k.fy, -1);
        const auto seed = static_cast<std::uint32_t>(y) * 65536 + static_cast<std::uint32_t>(x);
        const Vector3f share = catcher.arriving_share(camera.pose.world_from_camera(ray * z),
                                                      kRelativeRayOffset * z, seed);
        for (std::size_t c = 0; c < 3; ++c) {
          const float taken = 1 - share(c);
          if (taken > 0) {
            image.rgba[4 * pixel + c] *= 1 - static_cast<float>(settings.strength) * taken;
          }
        }
      }
    }
  });
}

}  // namespace raystage::compose
