// SPDX-License-Identifier: Apache-2.0
// Tells the two surfaces of a layer's pixels at edges of depth apart. Opacity and clips scale what
// is seen of each surface. So the part that is seen is kept until then, B (1 - A) with the front's
// A before, and divided by 1 - A as it is after. Cost: a second image; otherwise that of the edges.
#include "compose/layers/layer_surfaces.h"

#include <algorithm>
#include <utility>

namespace raystage::compose {
namespace {

/// Returns a transparent image with the AOVs of another one.
LayerImage empty_image_like(const LayerImage& image) {
  LayerImage empty = transparent_layer_image(image.width, image.height);
  for (const Aov& aov : image.aovs) {
    empty.aovs.push_back({aov.layer, aov.channels, aov.is_colour, aov.empty_value, {}});
    empty.aovs.back().values.assign(aov.values.size(), aov.empty_value);
  }
  if (!image.ids.empty()) empty.ids.assign(image.ids.size(), 0.0F);
  return empty;
}

}  // namespace

LayerSurfaces separate_surfaces(LayerImage image) {
  if (image.edges.empty()) return {std::move(image)};
  LayerImage behind = empty_image_like(image);
  for (const render::EdgePixel& edge : image.edges) {
    const std::size_t pixel = edge.pixel;
    const float through = 1 - edge.front[3];
    for (std::size_t c = 0; c < 4; ++c) {
      image.rgba[4 * pixel + c] = edge.front[c];
      behind.rgba[4 * pixel + c] = through * edge.behind[c];
    }
    image.z[pixel] = edge.front_z;
    behind.z[pixel] = edge.behind_z;
    for (std::size_t a = 0; a < image.aovs.size(); ++a) {
      const std::size_t channels = image.aovs[a].channels.size();
      std::copy_n(&image.aovs[a].values[channels * pixel], channels,
                  &behind.aovs[a].values[channels * pixel]);
    }
    if (image.ids.empty()) continue;
    std::copy_n(&image.ids[2 * kIdRanks * pixel], 2 * kIdRanks, &behind.ids[2 * kIdRanks * pixel]);
  }
  image.edges.clear();
  return {std::move(image), std::move(behind)};
}

void cover_behind(LayerSurfaces& surfaces) {
  if (!surfaces.behind) return;
  LayerImage& behind = *surfaces.behind;
  for (std::size_t pixel = 0; pixel < behind.pixels(); ++pixel) {
    float* rgba = &behind.rgba[4 * pixel];
    if (!(rgba[3] > 0)) continue;
    const float through = 1 - surfaces.image.rgba[4 * pixel + 3];
    if (!(through > 0)) continue;
    for (std::size_t c = 0; c < 3; ++c) rgba[c] /= through;
    rgba[3] = std::min(1.0F, rgba[3] / through);
  }
}

}  // namespace raystage::compose
