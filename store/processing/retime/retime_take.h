// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/run_status.h"
#include "store/processing/retime/retime_plan.h"
#include "store/take.h"

namespace raystage::store {

struct RetimeReport {
  RunStatus status = RunStatus::kNotRun;
  std::uint64_t interpolated = 0;  ///< frames computed for their tick
  std::uint64_t unchanged = 0;     ///< frames copied byte for byte, at their own times
  /// Of `unchanged`, with optical flow: frames with a rolling shutter which have no other one near
  /// enough, so that their rows keep their own times.
  std::uint64_t uncorrected = 0;
  std::uint64_t missing = 0;  ///< ticks without a frame, with a record of the loss or not
  std::uint64_t rotten = 0;   ///< frames that were needed, but left out: not as recorded (XXH3)
  std::vector<std::string> rotten_cameras;  ///< ids of the cameras of these, in the take's order
  double ms_per_interpolated = 0;  ///< decode, flow and encode per frame, by one or two threads
};

/// Writes a new take whose frames are at the ticks of `timeline`, with a timeline of its own.
/// `take` is not changed. Cameras run in parallel, with about 60 bytes of memory per pixel and
/// thread, 90 of pictures of more than 8 bits; the files do not depend on the number of threads.
/// Interpolated frames are JPEGs, 4:4:4 with restart markers, or where the camera has pictures of
/// more than 8 bits such pictures, compressed without loss, with light from 0 to the stated peak.
/// Their sequence number in the journal is the index of the nearer source frame. A
/// missing frame with a record in `take` near the tick keeps its reason, with sequence 0. Without
/// such a record the new journal has none either, and the frame is absent in the timeline. `times`:
/// ResyncResult::times. With optical flow all cameras of the new rig.json have a global shutter:
/// rows are moved from their own times to that of the frame. take.json records `created_by`, the
/// original's name and the method. With RetimeOptions::rotten_frames kAbsent, a frame whose bytes
/// are not as recorded counts as missing: its tick is interpolated as across a lost frame, or lacks
/// the camera. Throws RottenFrame for it with kError; Error: bad input if the folder exists or is
/// within `take`, or a frame is damaged; failed if writing fails or `stop` is requested. No files
/// remain then.
RetimeReport retime_take(const Take& take, const Timeline& timeline,
                         const std::vector<std::vector<Nanoseconds>>& times,
                         const RetimeOptions& options, const std::filesystem::path& folder,
                         const std::string& created_by, const std::function<void(double)>& progress,
                         const std::stop_token& stop);

}  // namespace raystage::store
