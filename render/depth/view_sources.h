// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "render/depth/depth.h"

namespace raystage::depth {

/// The cameras that a view's pixels are blended from, of those that this host holds: where they see
/// the view's points, and their frames, decoded where the view reads them.
class ViewSources {
 public:
  struct Source {
    DepthSource look_up;     ///< its rgba stays null if nothing of the camera is seen
    PixelTransfer transfer;  ///< from the view to the camera's depth map
    McuMask wanted;
    std::shared_ptr<const DecodedFrame> frame;  ///< null: not read
    bool used = false;
  };

  /// Determines the cameras and the pixels of theirs that are read. Keeps references to the
  /// arguments. Throws Error (bad input) if a frame cannot be read.
  ViewSources(const ViewRequest& request, const DepthViewPlan& plan);
  void decode(RenderStatistics& statistics);

  const Source& source(int camera) const { return sources_[static_cast<std::size_t>(camera)]; }
  std::vector<Source>& all() { return sources_; }
  /// Returns the inverse depths of the view's pixels from (x, y) on.
  const float* depths_at(int x, int y) const {
    return plan_.view_depths.values.data() + static_cast<std::ptrdiff_t>(y) * request_.view.width +
           x;
  }

 private:
  struct Range {
    float farthest = 0, nearest = 0;
  };
  Range range_of(const BlendingField::Tile& tile) const;

  const ViewRequest& request_;
  const DepthViewPlan& plan_;
  std::vector<Source> sources_;  // per camera of the rig
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

}  // namespace raystage::depth
