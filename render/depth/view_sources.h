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
  ViewSources(const ViewRequest& request, const Plan& plan);
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
  Range range_of(const CameraField::Tile& tile) const;

  const ViewRequest& request_;
  const Plan& plan_;
  std::vector<Source> sources_;  // per camera of the rig
};

/// Samples, shares and visibility of a run of a tile's pixels in one camera: what a run is blended
/// from. `n`: pixels, kMostRun at most; arrays of kMostRun, `samples` of four times as many.
struct CameraRun {
  float* samples = nullptr;  ///< R, G, B, seen per pixel
  float* shares = nullptr;
  float* visible = nullptr;
};
void sample_camera(const ViewSources& sources, const Plan& plan, const CameraField::Tile& tile,
                   const CameraField::TileCamera& camera, int y, const CameraRun& run);

}  // namespace raystage::depth
