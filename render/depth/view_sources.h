// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "render/depth/depth.h"

namespace raystage::depth {

/// The cameras that a view's pixels are blended from, as far as this host holds them: where they
/// see the view's points, and their frames, decoded as far as the view reads them.
class ViewSources {
 public:
  struct Source {
    DepthSource look_up;     ///< its rgba stays null where nothing of the camera is seen
    PixelTransfer transfer;  ///< from the view to where its depths are kept
    McuMask wanted;
    std::shared_ptr<const DecodedFrame> frame;  ///< null: nothing of it is read
    bool used = false;
  };

  /// Finds which cameras take part, and which of their pixels. Keeps references. Throws Error (bad
  /// input) for frames that cannot be read.
  ViewSources(const ViewRequest& request, const DepthViewPlan& plan);
  void decode(RenderStatistics& statistics);

  const Source& source(int camera) const { return sources_[static_cast<std::size_t>(camera)]; }
  std::vector<Source>& all() { return sources_; }
  /// Inverse depths of the view's pixels from (x, y) on.
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

/// Samples, weights and visibility of a run of a tile's pixels in one camera: what a run is blended
/// from. `n`: pixels, kMaxRunPixels at most; arrays of kMaxRunPixels, `samples` of four times as
/// many.
struct CameraRun {
  float* samples = nullptr;  ///< R, G, B, seen per pixel
  float* weights = nullptr;
  float* visible = nullptr;
};
void sample_camera(const ViewSources& sources, const DepthViewPlan& plan,
                   const BlendingField::Tile& tile, const BlendingField::TileCamera& camera, int y,
                   const CameraRun& run);

}  // namespace raystage::depth
