// SPDX-License-Identifier: Apache-2.0
// Casts shadows of meshes on a light field, whose surface is its depth image. Per pixel: `rays`
// directions over the sphere for ambient occlusion within `reach` (metres), and shadow rays from
// points spread over the pixel to points spread over each light, traced with Embree. Colours of a
// premultiplied image with depth (metres) are multiplied by the share of light that arrives. Cost:
// pixels x (rays + shadow rays x lights) x meshes.
#include "compose/geometry/shadow_catcher.h"

#include <algorithm>
#include <array>
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

constexpr int kPointLightRays = 16, kSizedLightRays = 64;  // per pixel and light

/// Returns a direction of the unit sphere, uniformly for `at` in [0, 1)^2.
Vector3d direction_at(const std::array<double, 2>& at) {
  const double up = 1 - 2 * at[0], around = 2 * std::numbers::pi * at[1];
  const double out = std::sqrt(std::max(0.0, 1 - up * up));
  return {out * std::cos(around), up, out * std::sin(around)};
}

/// Returns how much 1 / depth grows per pixel to the right and down; a plane has constant slopes.
/// Of the differences to both neighbours the smaller counts, so that edges of depth have none.
std::array<double, 2> inverse_depth_slopes(const LayerImage& image, int x, int y) {
  const auto inverse_at = [&](int column, int row) {
    if (column < 0 || row < 0 || column >= image.width || row >= image.height) return 0.0;
    const std::size_t at = static_cast<std::size_t>(row) * image.width + column;
    return image.z[at] > 0 ? 1 / double{image.z[at]} : 0.0;
  };
  const double here = inverse_at(x, y);
  const auto slope = [here](double before, double after) {
    const double back = here - before, ahead = after - here;
    // A neighbour without depth, or a local extreme.
    if (before <= 0 || after <= 0 || back * ahead <= 0) return 0.0;
    const double smaller = std::abs(back) < std::abs(ahead) ? back : ahead;
    return std::clamp(smaller, -here / 2, here / 2);  // in front of the camera over the pixel
  };
  return {slope(inverse_at(x - 1, y), inverse_at(x + 1, y)),
          slope(inverse_at(x, y - 1), inverse_at(x, y + 1))};
}

class Catcher {
 public:
  Catcher(const GeometryScene& scene, const ShadowCatcher& settings)
      : scene_(scene), settings_(settings) {
    for (const MeshInstance& mesh : scene.meshes) {
      const double scale = mesh.world_from_object.linear().colwise().norm().maxCoeff();
      centres_.emplace_back(mesh.world_from_object * mesh.scene->centre());
      radii_.push_back(scale * mesh.scene->radius());
    }
  }

  /// Returns the share of all light that arrives at a pixel, R, G, B. `point_at`: the surface's
  /// point at an offset in pixels from the pixel's centre. `seed`: of the pixel.
  template <class PointAt>
  Vector3f arriving_share(const PointAt& point_at, double min_distance, std::uint32_t seed) {
    const Vector3d centre = point_at(0.0, 0.0);
    const float hidden = ambient_occlusion(centre, min_distance, seed);
    Vector3f light_sum = scene_.lights.ambient, taken = hidden * scene_.lights.ambient;
    for (const DirectLight& light : scene_.lights.direct) {
      const auto strength = static_cast<float>(light_strength(light, centre));
      light_sum += strength * light.color;
      if (!light.casts_shadows) continue;
      taken += strength * occluded_share(light, point_at, min_distance, seed) * light.color;
      seed += 0x9E3779B9U;
    }
    Vector3f share = Vector3f::Ones();
    for (Eigen::Index c = 0; c < 3; ++c) {
      // Without lights, all light is assumed to be ambient.
      share(c) -= light_sum(c) > 0 ? taken(c) / light_sum(c) : hidden;
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
    reach_.assign(rays_.size(), settings_.reach);
    return std::min(1.0F, 2 * static_cast<float>(count_hits(min_distance)) /
                              static_cast<float>(settings_.rays));
  }

  /// Returns the share of a light that meshes hide from a pixel.
  template <class PointAt>
  float occluded_share(const DirectLight& light, const PointAt& point_at, double min_distance,
                       std::uint32_t seed) {
    const int rays = light.has_size() ? kSizedLightRays : kPointLightRays;
    const auto count = static_cast<std::uint32_t>(rays);
    rays_.clear();
    reach_.clear();
    for (std::uint32_t i = 0; i < count; ++i) {
      // Independent sequences, of the pixel and of the light.
      const auto [across, down] = r2_sample(seed, i);
      const Vector3d point = point_at(across - 0.5, down - 0.5);
      const LightSample sample = sample_light(light, point, r2_sample(~seed, (i * 29U) % count));
      rays_.push_back({point, sample.towards});
      reach_.push_back(sample.distance);
    }
    return static_cast<float>(count_hits(min_distance)) / static_cast<float>(rays);
  }

  /// Returns the number of rays that hit a mesh within their reach.
  std::ptrdiff_t count_hits(double min_distance) {
    blocked_.assign(rays_.size(), 0);
    for (const MeshInstance& mesh : scene_.meshes) {
      mesh.scene->occlude(mesh.object_from_world, rays_, min_distance, reach_, blocked_);
    }
    return std::ranges::count(blocked_, 1);
  }

  const GeometryScene& scene_;
  const ShadowCatcher& settings_;
  std::vector<Vector3d> centres_;
  std::vector<double> radii_;
  std::vector<render::WorldRay> rays_;
  std::vector<double> reach_;  ///< of each ray, metres
  std::vector<std::uint8_t> blocked_;
};

}  // namespace

void apply_shadow_catcher(const GeometryScene& scene, const render::VirtualCamera& camera,
                          const ShadowCatcher& settings, LayerImage& image) {
  if (scene.meshes.empty() || settings.strength <= 0) return;
  parallel_for(tbb::blocked_range<int>(0, image.height), [&](const tbb::blocked_range<int>& rows) {
    Catcher catcher(scene, settings);
    for (int y = rows.begin(); y < rows.end(); ++y) {
      for (int x = 0; x < image.width; ++x) {
        const std::size_t pixel = static_cast<std::size_t>(y) * image.width + x;
        const double z = double{image.z[pixel]};
        if (!std::isfinite(z) || image.rgba[4 * pixel + 3] <= 0) continue;
        const auto [slope_right, slope_down] = inverse_depth_slopes(image, x, y);
        const auto point_at = [&, slope_right = slope_right, slope_down = slope_down](double right,
                                                                                      double down) {
          return render::point_at_depth(camera, x + 0.5 + right, y + 0.5 + down,
                                        1 / (1 / z + slope_right * right + slope_down * down));
        };
        const auto seed = static_cast<std::uint32_t>(y) * 65536 + static_cast<std::uint32_t>(x);
        const Vector3f share = catcher.arriving_share(point_at, kRelativeRayOffset * z, seed);
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
