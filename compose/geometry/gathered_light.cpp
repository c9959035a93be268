// SPDX-License-Identifier: Apache-2.0
// Shares rays between neighbours: light from a scene changes slowly along a surface, the rays'
// noise does not. A filter over a square of pixels, in which surfaces that differ do not count.
// Input: sums per pixel, world positions (metres) and normals. Output: scene-linear colours. Cost:
// 25 neighbours per pixel.
#include "compose/geometry/gathered_light.h"

#include <algorithm>
#include <cassert>

#include "base/parallel.h"

namespace raystage::compose {
namespace {

using Eigen::Vector3f;

/// Weight 0: normals this far apart (cosine), and points this far from the pixel's tangent plane
/// (in widths of the pixel, for each pixel of distance in the image).
constexpr float kLeastCosine = 0.9F, kPlaneDistance = 1.5F;

Vector3f value_of(const Aov& aov, std::size_t pixel) {
  return {aov.values[3 * pixel], aov.values[3 * pixel + 1], aov.values[3 * pixel + 2]};
}

/// Returns how well two surfaces agree, in [0, 1]. `tolerance`: metres.
float agreement(const Vector3f& normal, const Vector3f& other_normal, const Vector3f& to_other,
                float tolerance) {
  const float turned = (normal.dot(other_normal) - kLeastCosine) / (1 - kLeastCosine);
  if (!(tolerance > 0)) return 0;
  const float off_plane =
      std::max(std::abs(normal.dot(to_other)), std::abs(other_normal.dot(to_other)));
  return std::clamp(turned, 0.0F, 1.0F) * std::clamp(2 - 2 * off_plane / tolerance, 0.0F, 1.0F);
}

}  // namespace

void share_gathered_light(const GatheredLight& gathered, const render::VirtualCamera& camera,
                          int samples, LayerImage& image) {
  assert(image.aovs.size() >= 2 && image.aovs[1].layer == "N");
  constexpr int kReach = kGatheringTile / 2;
  const auto pixel_angle = static_cast<float>(render::pixel_angle(camera));
  // From the eye, not from the world's origin, which may be too far away for floats.
  std::vector<Vector3f> from_eye(image.pixels(), Vector3f::Zero());
  parallel_for(0, image.height, [&](int y) {
    for (int x = 0; x < image.width; ++x) {
      const auto pixel = static_cast<std::size_t>(y) * image.width + x;
      if (gathered.samples[pixel] == 0) continue;
      const Eigen::Vector3d point =
          render::point_at_depth(camera, x + 0.5, y + 0.5, double{image.z[pixel]});
      from_eye[pixel] = (point - camera.pose.position).cast<float>();
    }
  });
  parallel_for(0, image.height, [&](int y) {
    for (int x = 0; x < image.width; ++x) {
      const auto pixel = static_cast<std::size_t>(y) * image.width + x;
      if (gathered.samples[pixel] == 0) continue;
      const Vector3f normal = value_of(image.aovs[1], pixel);
      const float width = pixel_angle * from_eye[pixel].norm();
      Vector3f sum = gathered.radiance[pixel];
      auto weight = static_cast<float>(gathered.samples[pixel]);
      for (int v = std::max(0, y - kReach); v <= std::min(image.height - 1, y + kReach); ++v) {
        for (int u = std::max(0, x - kReach); u <= std::min(image.width - 1, x + kReach); ++u) {
          const auto other = static_cast<std::size_t>(v) * image.width + u;
          if (gathered.samples[other] == 0 || other == pixel) continue;
          const auto steps = static_cast<float>(std::max(std::abs(u - x), std::abs(v - y)));
          const float agrees =
              agreement(normal, value_of(image.aovs[1], other), from_eye[other] - from_eye[pixel],
                        kPlaneDistance * width * steps);
          // Infinite light stays in its own pixel.
          if (!(agrees > 0) || !gathered.radiance[other].allFinite()) continue;
          sum += agrees * gathered.radiance[other];
          weight += agrees * static_cast<float>(gathered.samples[other]);
        }
      }
      const Vector3f light = gathered.color[pixel].cwiseProduct(sum / weight);
      for (std::size_t c = 0; c < 3; ++c) {
        image.rgba[4 * pixel + c] +=
            light(static_cast<Eigen::Index>(c)) / static_cast<float>(samples);
      }
    }
  });
}

}  // namespace raystage::compose
