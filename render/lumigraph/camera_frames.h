// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "render/common/light_field_frame.h"
#include "render/common/view.h"
#include "render/sampling/source_view.h"

namespace raystage {

/// The frames of an instant, decoded as far as a view reads them; or, each after the other, as far
/// as parts of a view do.
class CameraFrames {
 public:
  /// `count_needed`: also note which pixels are read, for RenderStatistics::pixels_needed.
  CameraFrames(const LightFieldFrame& instant, bool count_needed);

  /// Looks at the frames of the cameras that are `used`, indexed as in the rig, and lets go of
  /// those of the part before. Throws Error (bad input).
  void open(std::vector<bool> used);
  /// Whether decode() needs no plan: every frame is in memory already, and nobody counts.
  bool are_fully_decoded() const;

  /// Makes a camera's lens mark what is wanted of its frame; to no end where it is not used.
  void set_mcu_layout(int camera, SourceView& lens);

  /// What is wanted of each frame; all of those that were not planned. Counts what all parts of the
  /// view took: needed pixels once.
  void decode(RenderStatistics& statistics);
  /// Null for a camera that is not used.
  const std::uint16_t* pixels(int camera) const {
    const auto& frame = frames_[static_cast<std::size_t>(camera)];
    return frame ? frame->rgba.get() : nullptr;
  }

 private:
  const LightFieldFrame& instant_;
  bool count_needed_;
  std::vector<bool> used_;
  std::vector<std::uint8_t> looked_through_;  // of any part
  std::vector<std::shared_ptr<const JpegLayout>> layouts_;
  std::vector<McuMask> wanted_;                         // empty: all
  std::vector<std::vector<std::uint8_t>> read_pixels_;  // empty: nobody counts
  std::vector<std::shared_ptr<const DecodedFrame>> frames_;
};

}  // namespace raystage
