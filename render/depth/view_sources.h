// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "render/depth/depth.h"
#include "render/sampling/field_sources.h"

namespace raystage::render::depth {

/// The cameras that a view's pixels are blended from, and where they see them.
class ViewSources : public FieldSources {
 public:
  /// Keeps references to the arguments. Throws Error (bad input) if a frame cannot be read.
  ViewSources(const ViewRequest& request, const DepthViewPlan& plan);

  /// Returns the inverse depths of the view's pixels from (x, y) on.
  const float* depths_at(int x, int y) const {
    return plan_.view_depths.values.data() + plan_.view_depths.offset(x, y);
  }
  /// Returns the transfer from the view to the depth map of a used camera.
  const PixelTransfer& transfer(int camera) const { return transfers_[camera]; }

 private:
  const DepthViewPlan& plan_;
  std::vector<PixelTransfer> transfers_;  // per camera of the rig
};

/// Samples, weights and visibility of one camera for a run of a tile's pixels. Arrays of
/// kMaxRunPixels; `samples` has four times as many.
struct CameraRun {
  float* samples = nullptr;  ///< R, G, B, seen per pixel
  float* weights = nullptr;
  float* visible = nullptr;
};
/// Fills `run` for the pixels of row y of a tile.
void sample_camera(const ViewSources& sources, const DepthViewPlan& plan,
                   const BlendingField::Tile& tile, const BlendingField::TileCamera& camera, int y,
                   const CameraRun& run);

}  // namespace raystage::render::depth
