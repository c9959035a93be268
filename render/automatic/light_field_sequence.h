// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "render/common/light_field_frame.h"
#include "store/timeline.h"

namespace raystage {

/// The instants of a take: the ticks of its timeline, with the frames that these select (clocks
/// corrected, frames that are not to be trusted left out); where it has none, the frames of the
/// first member and what the other cameras stamped within tolerance_of_stamps() of them.
class LightFieldSequence {
 public:
  /// Of the take and included_cameras of `now`, which has to stay. Throws Error (bad input) where
  /// the timeline cannot be read.
  explicit LightFieldSequence(const LightFieldFrame& now);

  int count() const;
  LightFieldFrame at(int index) const;

 private:
  const LightFieldFrame& now_;
  std::vector<FrameSelection> ticks_;  ///< empty: by stamps
};

}  // namespace raystage
