// SPDX-License-Identifier: Apache-2.0
// Converts images of layers to deep samples: one sample per visible image and pixel, sorted by
// depth. Input: layer images with depth (metres); output: premultiplied samples from front to back
// whose "over" composite equals merge() by depth. Cost: pixels x layers x log(layers).
#include "compose/layers/deep_image.h"

#include <algorithm>
#include <numeric>

namespace raystage::compose {

DeepImage make_deep_image(std::span<const MergedLayer> layers) {
  const LayerImage& first = *layers.front().image;
  DeepImage deep;
  deep.width = first.width;
  deep.height = first.height;
  deep.begin.reserve(first.pixels() + 1);
  std::vector<std::size_t> front_first(layers.size());
  for (std::size_t pixel = 0; pixel < first.pixels(); ++pixel) {
    deep.begin.push_back(static_cast<std::uint32_t>(deep.samples.size()));
    std::iota(front_first.rbegin(), front_first.rend(), std::size_t{0});
    std::ranges::stable_sort(front_first, {},
                             [&](std::size_t i) { return layers[i].image->z[pixel]; });
    // Holdouts attenuate the layers behind them but have no sample: the samples behind them are
    // scaled so that "over" of the samples alone gives the same composite.
    double through = 1, through_samples = 1;
    for (const std::size_t i : front_first) {
      const float* rgba = layers[i].image->rgba.data() + 4 * pixel;
      if (!layers[i].is_holdout && through > 0 &&
          std::any_of(rgba, rgba + 4, [](float value) { return value != 0; })) {
        const double scale = through / through_samples;
        DeepImage::Sample sample{};
        for (std::size_t c = 0; c < 4; ++c) {
          sample.rgba[c] = static_cast<float>(scale * static_cast<double>(rgba[c]));
        }
        sample.z = std::clamp(layers[i].image->z[pixel], 0.0F, kBackgroundDepth);
        deep.samples.push_back(sample);
        through_samples *= 1 - static_cast<double>(sample.rgba[3]);
      }
      through *= 1 - static_cast<double>(rgba[3]);
    }
  }
  deep.begin.push_back(static_cast<std::uint32_t>(deep.samples.size()));
  return deep;
}

}  // namespace raystage::compose
