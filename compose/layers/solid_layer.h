// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "compose/layers/layer.h"
#include "schemas/shot_document.h"

namespace raystage {

/// A layer of one colour (working space), with one depth or none.
class SolidLayer final : public Layer {
 public:
  explicit SolidLayer(const ShotDocument::Solid& solid) : solid_(solid) {}

  std::unique_ptr<const LayerRenderer> make_renderer(
      const LayerRendererSettings& settings) const override;

 private:
  ShotDocument::Solid solid_;
};

}  // namespace raystage
