// SPDX-License-Identifier: Apache-2.0
#include "compose/layers/solid_layer.h"

#include <algorithm>

namespace raystage::compose {
namespace {

class SolidRenderer final : public LayerRenderer {
 public:
  explicit SolidRenderer(const schemas::ShotDocument::Solid& solid) : solid_(solid) {}

  LayerImage render(const LayerView& view) const override {
    LayerImage image = transparent_layer_image(view.camera.view.width, view.camera.view.height);
    for (std::size_t pixel = 0; pixel < image.pixels(); ++pixel) {
      for (std::size_t c = 0; c < 3; ++c) {
        image.rgba[4 * pixel + c] = static_cast<float>(solid_.color[c] * solid_.alpha);
      }
      image.rgba[4 * pixel + 3] = static_cast<float>(solid_.alpha);
    }
    if (solid_.depth_m) std::ranges::fill(image.z, static_cast<float>(*solid_.depth_m));
    return image;
  }

 private:
  schemas::ShotDocument::Solid solid_;
};

}  // namespace

std::unique_ptr<const LayerRenderer> SolidLayer::make_renderer(
    const LayerRendererOptions& /*options*/) const {
  return std::make_unique<const SolidRenderer>(solid_);
}

}  // namespace raystage::compose
