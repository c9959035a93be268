// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <map>
#include <mutex>
#include <utility>
#include <vector>

#include "compose/layers/layer.h"
#include "render/common/view.h"

namespace raystage::compose {

class ShotPlan;

/// The views that all frames of a shot show of the light field frames of its takes, whichever
/// frames are rendered. Thread-safe; the first question costs microseconds per frame of the shot.
class ShownViews {
 public:
  /// Keeps a reference to `plan`. `policy`: for frames for which a take has no light field frame.
  ShownViews(const ShotPlan& plan, MissingFrames policy) : plan_(plan), policy_(policy) {}

  /// Returns the views, both eyes' and while the shutter is open, of a tick (ShownTick::tick) of a
  /// layer. Empty: any may be shown, also where time stands (in the mean more than
  /// render::kMostFramesOfShownViews frames show a tick, or more than twice as many this one), or
  /// single rays are asked of the layer. Empty also if its method does not depend on them.
  std::vector<render::VirtualCamera> of(std::size_t layer, int tick) const;

 private:
  /// Times within the shot, frames, at which a light field frame is shown.
  struct Times {
    std::vector<double> times;
    std::size_t frames = 0;
    int last_frame = 0;
  };

  void find_times() const;
  /// Forgets the times of a layer if its ticks are shown by many frames each.
  void forget_if_time_stands(std::size_t layer) const;
  bool depends_on_views(std::size_t layer) const;

  const ShotPlan& plan_;
  MissingFrames policy_;
  mutable std::once_flag found_;
  mutable std::map<std::pair<std::size_t, int>, Times> times_;  // by layer and tick
};

}  // namespace raystage::compose
