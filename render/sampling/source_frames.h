// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "render/common/light_field_frame.h"
#include "render/common/plane_projection.h"
#include "render/sampling/source_view.h"

namespace raystage::render {

/// The source cameras of a light field frame for one view: their geometry, the parts of their
/// frames that are needed, and the decoded frames. Use in this order: open(), mark (mark_run,
/// mark_block), decode(), blend.
class SourceFrames {
 public:
  /// `count_needed`: cameras also get a pixel mask. Keeps references to the arguments.
  SourceFrames(const LightFieldFrame& instant, const PlaneProjection& projection,
               bool count_needed);

  /// Sets geometry and frame layout of the listed cameras, which must be present.
  void open(const std::vector<int>& cameras);
  /// Returns whether marking is unnecessary because all frames are in memory as a whole.
  bool are_fully_decoded() const;
  /// Decodes what was marked. Cameras without marks keep a null frame.
  void decode(RenderStatistics& statistics);

  SourceView& view(int camera) { return sources_[camera].view; }

 private:
  struct Source {
    SourceView view;
    store::McuMask wanted;  // empty: all, which is in memory already
    std::vector<std::uint8_t> read_pixels;
    std::shared_ptr<const store::DecodedFrame> frame;
  };
  const LightFieldFrame& instant_;
  const PlaneProjection& projection_;
  bool count_needed_;
  std::vector<Source> sources_;  // per camera of the rig
  std::vector<int> opened_;
};

}  // namespace raystage::render
