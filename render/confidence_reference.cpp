// SPDX-License-Identifier: Apache-2.0
// Reference of measure_confidence() (confidence.cpp), per pixel in double: the mean agreement of
// the cameras of the pixel's tile by their weights, each sampled at the pixel's depth. Input: R, G,
// B, A and depth of a view. Output: 0 to 1 per pixel. Cost: pixels x 4 cameras, all frames decoded
// whole.
#include <map>

#include "base/parallel.h"
#include "render/agreement.h"
#include "render/confidence.h"
#include "render/sampling/depth_sampling.h"
#include "store/processing/frames/frame_cache.h"

namespace raystage::render {

void measure_confidence_reference(const VirtualCamera& view, const LightFieldFrame& instant,
                                  RenderedView& image) {
  using namespace confidence;  // NOLINT(google-build-using-namespace): of this folder
  image.confidence.assign(image.coverage.size(), 0.0F);
  const BlendingField field = make_blending_field(view, instant, shown_inverse_depth_range(image));
  const ViewRays rays(view);
  std::map<int, std::shared_ptr<const store::DecodedFrame>> frames;
  for (const BlendingField::Tile& tile : field.tiles()) {
    for (const BlendingField::TileCamera& chosen : tile.cameras) {
      auto& frame = frames[chosen.camera];
      if (frame) continue;
      const int shown = instant.frame_of_camera[chosen.camera];
      const auto layout = instant.cache->layout(chosen.camera, shown);
      std::int64_t decoded = 0;
      frame = instant.cache->fetch(
          chosen.camera, shown,
          store::McuMask(static_cast<std::size_t>(layout->mcu_count()), std::uint8_t{1}), decoded);
      image.statistics.pixels_decoded += decoded;
    }
  }
  raystage::parallel_for(0, view.height, [&](int y) {
    for (int x = 0; x < view.width; ++x) {
      const std::size_t at = image.index(x, y);
      const float* rgba = &image.rgba[4 * at];
      const auto ray = rays.through(x + 0.5, y + 0.5);
      if (!(rgba[3] > 0) || !ray) continue;
      const auto& tile = field.tile_at(x, y);
      double sum = 0;
      for (const BlendingField::TileCamera& camera : tile.cameras) {
        const DepthSample sample = sample_at_depth_reference(
            view.pose.position, *ray, inverse_depth_of(image.z[at]),
            instant.rig->cameras[camera.camera], *frames[camera.camera], Interpolation::kLinear);
        const double alpha = sample.alpha * sample.seen;
        if (!(alpha > 0)) continue;
        const SrgbCode code =
            srgb_code_of_sample(sample.code, sample.alpha, instant.cache->scale());
        sum += double{BlendingField::share(tile, camera, x, y)} *
               agreement(code, alpha, srgb_code_of_pixel(rgba, instant.cache->scale()),
                         double{rgba[3]});
      }
      image.confidence[at] = static_cast<float>(sum);
    }
  });
}

}  // namespace raystage::render
