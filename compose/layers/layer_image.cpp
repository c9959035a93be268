// SPDX-License-Identifier: Apache-2.0
#include "compose/layers/layer_image.h"

#include <cmath>
#include <limits>
#include <utility>

namespace raystage::compose {
namespace {

constexpr float kNoDepth = std::numeric_limits<float>::infinity();

/// Sets shares that are 1 but for the rounding of sums of weights to 1: layers behind are then
/// known to be hidden, and files are smaller.
void remove_rounding(float& share) {
  constexpr float kRounding = 1e-6F;
  if (std::abs(share - 1) < kRounding) share = 1;
}

}  // namespace

LayerImage transparent_layer_image(int width, int height) {
  LayerImage image;
  image.width = width;
  image.height = height;
  image.rgba.assign(image.pixels() * 4, 0.0F);
  image.z.assign(image.pixels(), kNoDepth);
  return image;
}

LayerImage make_layer_image(render::RenderedView view) {
  for (std::size_t i = 0; i < view.coverage.size(); ++i) {
    remove_rounding(view.coverage[i]);
    remove_rounding(view.rgba[4 * i + 3]);
  }
  for (render::EdgePixel& edge : view.edges) remove_rounding(edge.behind[3]);
  LayerImage image;
  image.width = view.width;
  image.height = view.height;
  image.rgba = std::move(view.rgba);
  image.z = std::move(view.z);
  image.aovs.push_back({"lf", {"coverage"}, false, 0, std::move(view.coverage)});
  if (!view.confidence.empty()) {
    image.aovs.push_back({"lf", {"confidence"}, false, 0, std::move(view.confidence)});
  }
  if (!view.cameras.empty()) {
    image.aovs.push_back({"lf", {"cameras"}, false, 0, std::move(view.cameras)});
  }
  if (!view.nearest_ray.empty()) {
    image.aovs.push_back({"lf", {"nearest"}, false, kNoDepth, std::move(view.nearest_ray)});
  }
  image.edges = std::move(view.edges);
  image.statistics = view.statistics;
  image.notes = std::move(view.notes);
  return image;
}

ExrView exr_view(const LayerImage& image, const std::string& name) {
  ExrView view{name, {}};
  view.layers.push_back({"", {"R", "G", "B", "A"}, true, image.rgba, 0});
  view.layers.push_back({"depth", {"Z"}, false, image.z, kNoDepth});
  for (const Aov& aov : image.aovs) {
    // Half is enough for unit vectors: its 11 bits resolve 1/30 degree.
    const bool is_normal = aov.layer == "N";
    view.layers.push_back(
        {aov.layer, aov.channels, aov.is_colour, aov.values, aov.empty_value, is_normal});
  }
  return view;
}

}  // namespace raystage::compose
