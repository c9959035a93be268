// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/time.h"
#include "rig/rig.h"
#include "store/timeline.h"

namespace raystage::store {

/// Returns the frames of a timeline at any time: of each camera the one that it took then, within a
/// two-hundredth of a tick's period, or the two before and after, between which the picture is
/// interpolated. Where these are more than 2.5 periods apart (two lost frames), or one of them does
/// not exist, the camera has its frame of the nearest tick, if that is within half a period of the
/// time. A timeline of one tick has its frames at any time. `timeline`: with at least one tick.
/// Frames of cameras with a rolling shutter are always interpolated where a frame before or after
/// is near enough, so that all rows show the time (or that of the frame's middle row, where the
/// camera has only its frame of the nearest tick). `rig`: of the take, for the line times.
FrameSelection frames_at_time(const Timeline& timeline, const rig::Rig& rig, Nanoseconds time);

}  // namespace raystage::store
