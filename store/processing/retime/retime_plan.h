// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "store/processing/retime/in_between.h"
#include "store/timeline.h"

namespace raystage {

struct RetimeSettings {
  RetimeMethod method = RetimeMethod::kFlow;
  /// No picture is made between two frames that lie further apart; 0: two and a half ticks, so that
  /// one lost frame is bridged and two are not.
  Nanoseconds longest_gap = 0;
  int quality = 95;  ///< of the JPEG of pictures that are made, 1-100
};

/// What one camera shows at one tick.
struct RetimedFrame {
  enum class Kind {
    kMissing,
    kAsItIs,  ///< frame `first`, byte for byte, at its own time
    kBetween  ///< `part` of the way from frame `first` to `second`, at the tick's time
  };
  Kind kind = Kind::kMissing;
  std::int32_t first = -1, second = -1;
  double part = 0;
  Nanoseconds time = 0;
};

/// A frame this near to its tick is not touched: part of a tick's period.
inline constexpr double kNearEnough = 0.005;

/// What camera `camera` shows at every tick of `timeline`. A frame that cannot be moved (nothing on
/// its other side, or too far away) stays as it is if the timeline takes it; it keeps its own time,
/// so it never passes for the tick's. `times`: corrected times of the camera's frames, as
/// Resync::times; kNoTime: not to be used.
std::vector<RetimedFrame> plan_retiming(const Timeline& timeline, std::size_t camera,
                                        const std::vector<Nanoseconds>& times,
                                        const RetimeSettings& settings);

}  // namespace raystage
