// SPDX-License-Identifier: Apache-2.0
// Measures the confidence of a view: samples four cameras around each ray at the pixel's depth and
// averages their agreement 1 / (1 + (d / 8)^2), d in 8-bit sRGB codes. Stages: source MCUs,
// decoding, comparison. Input: R, G, B, A and depth of a view. Output: 0 to 1 per pixel. Cost:
// pixels x 4 cameras. Must match measure_confidence_reference().

#include "render/confidence.h"

#include <algorithm>

#include "base/parallel.h"
#include "render/agreement.h"
#include "render/sampling/field_sources.h"
#include "store/processing/frames/frame_cache.h"

namespace raystage::render {
namespace {

using namespace confidence;  // NOLINT(google-build-using-namespace): of this file's own folder
using Tile = BlendingField::Tile;

class ConfidenceMeasurement {
 public:
  ConfidenceMeasurement(const VirtualCamera& view, const LightFieldFrame& instant,
                        RenderedView& image)
      : instant_(instant),
        image_(image),
        range_(shown_inverse_depth_range(image)),
        field_(make_blending_field(view, instant, range_)),
        sources_(view, instant, field_, ranges_of_tiles(), range_.farthest,
                 Interpolation::kLinear) {}

  void measure() {
    image_.confidence.assign(image_.coverage.size(), 0.0F);
    const auto start = RenderClock::now();
    RenderStatistics decoding;
    sources_.decode(decoding);
    image_.statistics.pixels_decoded += decoding.pixels_decoded;
    image_.statistics.decode_ms += milliseconds(RenderClock::now() - start);
    raystage::parallel_for(std::size_t{0}, field_.tiles().size(), [&](std::size_t i) {
      const Tile& tile = field_.tiles()[i];
      for (int y = tile.top; y < tile.bottom; ++y) compare(tile, y);
    });
  }

 private:
  /// Returns the inverse depth relative to range_.farthest; 0 for transparent pixels.
  float inverse_depth(std::size_t pixel) const {
    if (!(image_.rgba[4 * pixel + 3] > 0)) return 0;
    return static_cast<float>(inverse_depth_of(image_.z[pixel]) - range_.farthest);
  }

  /// Returns the range of depths in each tile, relative to range_.farthest.
  std::vector<InverseDepthRange> ranges_of_tiles() const {
    const std::vector<Tile>& tiles = field_.tiles();
    std::vector<InverseDepthRange> ranges(tiles.size(), {range_.nearest - range_.farthest, 0});
    raystage::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t i) {
      for (int y = tiles[i].top; y < tiles[i].bottom; ++y) {
        for (int x = tiles[i].left; x < tiles[i].right; ++x) {
          const double q{inverse_depth(image_.index(x, y))};
          ranges[i].farthest = std::min(ranges[i].farthest, q);
          ranges[i].nearest = std::max(ranges[i].nearest, q);
        }
      }
    });
    return ranges;
  }

  void compare(const Tile& tile, int y) {
    constexpr std::size_t kMax = BlendingField::kTile;
    const auto n = static_cast<std::size_t>(tile.right - tile.left);
    const std::size_t first = image_.index(tile.left, y);
    std::array<float, kMax> depths, share, whole;
    std::array<float, 4 * kMax> sums;
    std::array<SrgbCode, kMax> pixels;
    whole.fill(1);
    const store::CodeScale scale = instant_.cache->scale();
    for (std::size_t x = 0; x < n; ++x) {
      depths[x] = inverse_depth(first + x);
      const float* rgba = &image_.rgba[4 * (first + x)];
      if (rgba[3] > 0) pixels[x] = srgb_code_of_pixel(rgba, scale);
    }
    for (const BlendingField::TileCamera& camera : tile.cameras) {
      const FieldSources::Source& source = sources_[camera.camera];
      if (!source.frame) continue;
      BlendingField::weights(tile, camera, y, {share.data(), n});
      sums.fill(0);
      add_samples_at_depth(source.source, tile.left, y, {depths.data(), n}, {whole.data(), n},
                           Interpolation::kLinear, {sums.data(), 4 * n});
      for (std::size_t x = 0; x < n; ++x) {
        const double pixel_alpha{image_.rgba[4 * (first + x) + 3]};
        const double alpha = double{sums[4 * x + 3]} / 65535;
        if (!(pixel_alpha > 0) || !(alpha > 0)) continue;
        const SrgbCode sample = srgb_code_of_sample(
            {sums[4 * x] / 65535.0, sums[4 * x + 1] / 65535.0, sums[4 * x + 2] / 65535.0}, alpha,
            instant_.cache->scale());
        image_.confidence[first + x] +=
            share[x] * static_cast<float>(agreement(sample, alpha, pixels[x], pixel_alpha));
      }
    }
  }

  const LightFieldFrame& instant_;
  RenderedView& image_;
  const InverseDepthRange range_;
  const BlendingField field_;
  FieldSources sources_;
};

}  // namespace

void measure_confidence(const VirtualCamera& view, const LightFieldFrame& instant,
                        RenderedView& image) {
  ConfidenceMeasurement(view, instant, image).measure();
}

}  // namespace raystage::render
