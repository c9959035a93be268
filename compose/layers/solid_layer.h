// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "compose/layers/layer.h"
#include "schemas/shot_document.h"

namespace raystage::compose {

/// A layer of one colour (working space), with one depth or none.
class SolidLayer final : public Layer {
 public:
  explicit SolidLayer(const schemas::ShotDocument::Solid& solid) : solid_(solid) {}

  std::unique_ptr<const LayerRenderer> make_renderer(
      const LayerRendererOptions& options) const override;

 private:
  schemas::ShotDocument::Solid solid_;
};

}  // namespace raystage::compose
