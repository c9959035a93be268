// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "render/common/light_field_frame.h"
#include "render/common/plane_projection.h"
#include "render/sampling/source_view.h"

namespace raystage {

/// The cameras of an instant as one view samples them: how each lies to the view, what of its frame
/// is wanted, and the frame. First open, then mark (mark_run, mark_block), then decode, then blend.
class SourceFrames {
 public:
  /// `count_needed`: cameras get a mask of pixels too. Keeps references.
  SourceFrames(const LightFieldFrame& instant, const PlaneProjection& projection,
               bool count_needed);

  /// Geometry and frame layout of the cameras listed, which must be present.
  void open(const std::vector<int>& cameras);
  /// Whether marks change nothing: all frames are in memory as a whole.
  bool are_fully_decoded() const;
  /// Fetches what was marked. Cameras of which nothing was keep a null frame.
  void decode(RenderStatistics& statistics);

  SourceView& view(int camera) { return sources_[static_cast<std::size_t>(camera)].view; }

 private:
  struct Source {
    SourceView view;
    McuMask wanted;  // empty: all, which is in memory already
    std::vector<std::uint8_t> read_pixels;
    std::shared_ptr<const DecodedFrame> frame;
  };
  const LightFieldFrame& instant_;
  const PlaneProjection& projection_;
  bool count_needed_;
  std::vector<Source> sources_;  // per camera of the rig
  std::vector<int> opened_;
};

}  // namespace raystage
