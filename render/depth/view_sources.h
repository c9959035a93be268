// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "render/depth/depth.h"
#include "render/depth/surface_pairs.h"
#include "render/sampling/field_sources.h"

namespace raystage::render::depth {

/// The cameras that a view's pixels are blended from, and where they see them.
class ViewSources : public FieldSources {
 public:
  /// Keeps a reference to the request's instant. Throws Error (bad input) if a frame cannot be
  /// read.
  ViewSources(const ViewRequest& request, const DepthViewPlan& plan);

  /// Returns the transfer from the view to the depth map of a used camera.
  const PixelTransfer& transfer(int camera) const { return transfers_[camera]; }

 private:
  std::vector<PixelTransfer> transfers_;  // per camera of the rig
};

/// Pixels of a tile's row from x on, at most kMaxRunPixels, and inverse depths of points in them.
struct PixelRun {
  int x = 0, y = 0;
  std::span<const float> inverse_depth;
};
/// Samples, weights and visibility of one camera for a run of a tile's pixels. Arrays of
/// kMaxRunPixels; `samples` has four times as many.
struct CameraRun {
  float* samples = nullptr;  ///< R, G, B, seen per pixel
  float* weights = nullptr;
  float* visible = nullptr;
};
/// Fills `run` for pixels of a tile.
void sample_camera(const ViewSources& sources, const DepthViewPlan& plan,
                   const BlendingField::Tile& tile, const BlendingField::TileCamera& camera,
                   const PixelRun& pixels, const CameraRun& run);
/// How far a camera's frame shows each point of a run, times 65535: every `step`th value.
struct SeenByFrame {
  const float* values = nullptr;
  std::size_t step = 1;
};
/// Reduces the visibility of a camera at the front surfaces of pairs to the part whose own depths
/// are there (compute_surface_share()). Adds the camera to `shares`, of each pixel of the run.
void weigh_front_surfaces(const ViewSources& sources, const DepthViewPlan& plan, int camera,
                          const PixelRun& pixels, const SurfaceRun& surfaces, const CameraRun& run,
                          const SeenByFrame& seen, std::span<FrontShare> shares);

}  // namespace raystage::render::depth
