// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "render/common/light_field_frame.h"
#include "render/common/view.h"
#include "render/sampling/source_view.h"

namespace raystage::render {

/// The frames of an instant, decoded where a view or, in turn, its parts read them.
class CameraFrames {
 public:
  /// Opens no frame yet. `count_needed`: also record which pixels are read, for
  /// RenderStatistics::pixels_needed.
  CameraFrames(const LightFieldFrame& instant, bool count_needed);

  /// Opens the frames of the `used` cameras (by camera of the rig) and closes those of the part
  /// before. Throws Error (bad input) if a frame cannot be read.
  void open(std::vector<bool> used);
  /// Returns whether decode() needs no plan: all frames are in memory, and pixels are not counted.
  bool are_fully_decoded() const;

  /// Makes a camera's lens record which MCUs of its frame are wanted. No effect on unused cameras.
  void set_mcu_layout(int camera, SourceView& lens);

  /// Decodes the wanted parts of the frames, or all if none were planned. Adds the cost over all
  /// parts of the view; needed pixels count once.
  void decode(RenderStatistics& statistics);
  /// Returns null for a camera that is not used.
  const std::uint16_t* pixels(int camera) const {
    const auto& frame = frames_[camera];
    return frame ? frame->rgba.get() : nullptr;
  }

 private:
  const LightFieldFrame& instant_;
  bool count_needed_;
  std::vector<bool> used_;
  std::vector<std::uint8_t> looked_through_;  // in any part
  std::vector<std::shared_ptr<const store::JpegLayout>> layouts_;
  std::vector<store::McuMask> wanted_;                  // empty: all
  std::vector<std::vector<std::uint8_t>> read_pixels_;  // empty: not counted
  std::vector<std::shared_ptr<const store::DecodedFrame>> frames_;
};

}  // namespace raystage::render
