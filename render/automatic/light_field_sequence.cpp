// SPDX-License-Identifier: Apache-2.0
#include "render/automatic/light_field_sequence.h"

#include <algorithm>
#include <utility>

namespace raystage::render {

LightFieldSequence::LightFieldSequence(const LightFieldFrame& now) : now_(now) {
  if (auto timeline = store::read_timeline_if_present(*now.take))
    ticks_ = std::move(timeline->ticks);
}

int LightFieldSequence::count() const {
  if (!ticks_.empty()) return static_cast<int>(ticks_.size());
  return static_cast<int>(now_.take->archive(now_.included_cameras.front()).frames().size());
}

LightFieldFrame LightFieldSequence::at(int index) const {
  store::FrameSelection selection;
  if (ticks_.empty()) {
    const store::Take& take = *now_.take;
    selection = store::select_frames(
        take, take.archive(now_.included_cameras.front()).frames()[index].time_ns,
        store::default_frame_tolerance(take.document().nominal_fps));
  } else {
    selection = ticks_[index];
  }
  LightFieldFrame instant = now_;
  instant.time_ns = selection.time_ns;
  std::ranges::fill(instant.frame_of_camera, -1);
  for (const int camera : now_.included_cameras) {
    instant.frame_of_camera[camera] = selection.frame[camera];
  }
  return instant;
}

}  // namespace raystage::render
