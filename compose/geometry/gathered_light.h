// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "compose/layers/layer_image.h"
#include "render/common/view.h"

namespace raystage::compose {

/// Light that diffuse surfaces of a view gather from their surroundings, per pixel, row-major. Each
/// pixel has few rays; share_gathered_light() adds those of its neighbours.
struct GatheredLight {
  /// Sums over the samples of a pixel that meet a diffuse surface, R, G, B: of the mean radiance
  /// from the directions around the normal (weighted by the cosine), and of the surface's colour.
  std::vector<Eigen::Vector3f> radiance, color;
  std::vector<std::uint16_t> samples;  ///< number of these samples

  explicit GatheredLight(std::size_t pixels)
      : radiance(pixels, Eigen::Vector3f::Zero()),
        color(pixels, Eigen::Vector3f::Zero()),
        samples(pixels, 0) {}
  /// Also those that share_gathered_light() needs.
  static constexpr std::size_t kBytesPerPixel = 38;
};

/// Side of the square of neighbours, pixels.
inline constexpr int kGatheringTile = 5;

/// Returns which of the kGatheringTile^2 parts of a sequence of rays a pixel traces. All pixels of
/// a square of this side at any place have different parts.
constexpr std::uint32_t gathering_part(int x, int y) {
  return static_cast<std::uint32_t>(y % kGatheringTile * kGatheringTile + x % kGatheringTile);
}

/// Adds the gathered light to the colours of `image`: in each pixel the mean radiance of the square
/// around it, weighted by how well the neighbours' surfaces agree in normal and plane, times the
/// pixel's own colour (Keller and Heidrich, "Interleaved sampling", EGWR 2001; Wald et al.,
/// "Interactive global illumination using fast ray tracing", EGWR 2002: discontinuity buffer).
/// `image`: with Z, and N as its second AOV. `samples`: per pixel, of all surfaces.
void share_gathered_light(const GatheredLight& gathered, const render::VirtualCamera& camera,
                          int samples, LayerImage& image);

}  // namespace raystage::compose
