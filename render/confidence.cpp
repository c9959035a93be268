// SPDX-License-Identifier: Apache-2.0
// Confidence of a view: samples four cameras around each ray at the pixel's depth and averages
// their agreement 1 / (1 + (d / 8)^2), d in 8-bit sRGB codes. Finds source MCUs, decodes, compares.
// Input: R, G, B, A and depth of a view. Output: 0 to 1 per pixel. Cost: pixels x 4 cameras. Must
// match measure_confidence_reference().

#include "render/confidence.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>

#include "base/parallel.h"
#include "render/agreement.h"
#include "render/sampling/depth_planning.h"
#include "store/processing/frames/frame_cache.h"

namespace raystage {
namespace {

using namespace confidence;  // NOLINT(google-build-using-namespace): of this file's own folder
using Tile = BlendingField::Tile;

class ConfidenceMeasurement {
 public:
  ConfidenceMeasurement(const VirtualCamera& view, const LightFieldFrame& instant,
                        RenderedView& image)
      : view_(view),
        instant_(instant),
        image_(image),
        range_(shown_inverse_depth_range(image)),
        field_(make_blending_field(view, instant, range_)),
        sources_(instant.rig->cameras.size()) {}

  void measure() {
    image_.confidence.assign(image_.coverage.size(), 0.0F);
    find_sources();
    const auto start = std::chrono::steady_clock::now();
    decode();
    image_.statistics.decode_ms +=
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    raystage::parallel_for(0, field_.columns() * field_.rows(), [&](int i) {
      const Tile& tile = field_.tile(i % field_.columns(), i / field_.columns());
      for (int y = tile.top; y < tile.bottom; ++y) compare(tile, y);
    });
  }

 private:
  struct Source {
    DepthSource look_up;
    McuMask wanted;
    std::shared_ptr<const DecodedFrame> frame;
  };

  std::size_t at(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(view_.width) +
           static_cast<std::size_t>(x);
  }

  /// Returns the inverse depth relative to range_.farthest; 0 for transparent pixels.
  float inverse_depth(std::size_t pixel) const {
    if (!(image_.rgba[4 * pixel + 3] > 0)) return 0;
    return static_cast<float>(inverse_depth_of(image_.z[pixel]) - range_.farthest);
  }

  void find_sources() {
    for (int i = 0; i < field_.columns() * field_.rows(); ++i) {
      for (const auto& chosen : field_.tile(i % field_.columns(), i / field_.columns()).cameras) {
        sources_[static_cast<std::size_t>(chosen.camera)] = std::make_unique<Source>();
      }
    }
    raystage::parallel_for(std::size_t{0}, sources_.size(), [&](std::size_t camera) {
      if (!sources_[camera]) return;
      Source& source = *sources_[camera];
      source.look_up = depth_source(view_, instant_.rig->cameras[camera], range_.farthest);
      const auto layout =
          instant_.cache->layout(static_cast<int>(camera), instant_.frame_of_camera[camera]);
      source.wanted.assign(static_cast<std::size_t>(layout->mcu_count()), 0);
      set_mcu_layout(source.look_up.camera, *layout, source.wanted.data());
      for (int i = 0; i < field_.columns() * field_.rows(); ++i) {
        mark(field_.tile(i % field_.columns(), i / field_.columns()), static_cast<int>(camera),
             source);
      }
    });
  }

  void mark(const Tile& tile, int camera, Source& source) const {
    if (!std::ranges::binary_search(tile.cameras, camera, {}, &BlendingField::TileCamera::camera)) {
      return;
    }
    double least = range_.nearest - range_.farthest, most = 0;
    for (int y = tile.top; y < tile.bottom; ++y) {
      for (int x = tile.left; x < tile.right; ++x) {
        const double q{inverse_depth(at(x, y))};
        least = std::min(least, q);
        most = std::max(most, q);
      }
    }
    mark_block(source.look_up, {tile.left, tile.right, tile.top, tile.bottom, least, most},
               Interpolation::kLinear);
  }

  void decode() {
    std::atomic<std::int64_t> pixels = 0;
    raystage::parallel_for(std::size_t{0}, sources_.size(), [&](std::size_t camera) {
      if (!sources_[camera]) return;
      Source& source = *sources_[camera];
      if (std::ranges::find(source.wanted, 1) == source.wanted.end()) return;
      std::int64_t decoded = 0;
      source.frame = instant_.cache->fetch(
          static_cast<int>(camera), instant_.frame_of_camera[camera], source.wanted, decoded);
      source.look_up.camera.rgba = source.frame->rgba.get();
      pixels += decoded;
    });
    image_.statistics.pixels_decoded += pixels;
  }

  void compare(const Tile& tile, int y) {
    constexpr std::size_t kMost = BlendingField::kTile;
    const auto n = static_cast<std::size_t>(tile.right - tile.left);
    const std::size_t first = at(tile.left, y);
    std::array<float, kMost> depths, share, whole;
    std::array<float, 4 * kMost> sums;
    std::array<SrgbCode, kMost> pixels;
    whole.fill(1);
    const double full_scale = instant_.cache->full_scale();
    for (std::size_t x = 0; x < n; ++x) {
      depths[x] = inverse_depth(first + x);
      const float* rgba = &image_.rgba[4 * (first + x)];
      if (rgba[3] > 0) pixels[x] = srgb_code_of_pixel(rgba, full_scale);
    }
    for (const BlendingField::TileCamera& camera : tile.cameras) {
      const Source& source = *sources_[static_cast<std::size_t>(camera.camera)];
      if (!source.frame) continue;
      BlendingField::weights(tile, camera, y, {share.data(), n});
      sums.fill(0);
      add_samples_at_depth(source.look_up, tile.left, y, {depths.data(), n}, {whole.data(), n},
                           Interpolation::kLinear, {sums.data(), 4 * n});
      for (std::size_t x = 0; x < n; ++x) {
        const double pixel_alpha{image_.rgba[4 * (first + x) + 3]};
        const double alpha = double{sums[4 * x + 3]} / 65535;
        if (!(pixel_alpha > 0) || !(alpha > 0)) continue;
        const SrgbCode sample = srgb_code_of_sample(
            {sums[4 * x] / 65535.0, sums[4 * x + 1] / 65535.0, sums[4 * x + 2] / 65535.0}, alpha,
            instant_.cache->blend_space());
        image_.confidence[first + x] +=
            share[x] * static_cast<float>(agreement(sample, alpha, pixels[x], pixel_alpha));
      }
    }
  }

  const VirtualCamera& view_;
  const LightFieldFrame& instant_;
  RenderedView& image_;
  const InverseDepthRange range_;
  const BlendingField field_;
  std::vector<std::unique_ptr<Source>> sources_;  // per camera of the rig; null: not used
};

}  // namespace

void measure_confidence(const VirtualCamera& view, const LightFieldFrame& instant,
                        RenderedView& image) {
  ConfidenceMeasurement(view, instant, image).measure();
}

}  // namespace raystage
