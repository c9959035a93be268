// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "render/common/light_field_frame.h"
#include "store/timeline.h"

namespace raystage::render {

/// The light field frames of a take: the ticks of its timeline with their selected frames (with
/// clocks corrected and untrusted frames excluded). Without a timeline they are the frames of the
/// first included camera, with the frames of the others within default_frame_tolerance() of them.
class LightFieldSequence {
 public:
  /// Uses the take and included cameras of `now`, which must outlive it. Throws Error (bad input)
  /// where the timeline cannot be read.
  explicit LightFieldSequence(const LightFieldFrame& now);

  int count() const;
  LightFieldFrame at(int index) const;

 private:
  const LightFieldFrame& now_;
  std::vector<store::FrameSelection> ticks_;  ///< empty: frames are selected by time stamps
};

}  // namespace raystage::render
