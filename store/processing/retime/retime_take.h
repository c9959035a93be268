// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "store/processing/retime/retime_plan.h"
#include "store/take.h"

namespace raystage {

struct RetimeReport {
  std::uint64_t moved = 0;    ///< pictures made for their tick
  std::uint64_t as_were = 0;  ///< frames taken over byte for byte, at their own times
  std::uint64_t missing = 0;  ///< ticks without a picture, recorded as lost or not
  double ms_per_moved =
      0;  ///< time for each picture made, by one thread or two: decode, motion, encode
};

/// Writes a new take whose frames lie on the ticks of `timeline`, with a timeline of its own.
/// `take` stays as it is. Cameras are made side by side, about 60 bytes a pixel of memory for each
/// thread; the files do not depend on the number of threads. Pictures that are made are 4:4:4 with
/// restart markers; their journal's sequence is the index of the nearer of the two frames they come
/// from. A missing frame that `take` has a record of, around the tick, keeps its reason, with
/// sequence 0; one that it knows nothing of has no record here either, and is absent in the
/// timeline. `times`: Resync::times. `created_by` goes into take.json, with the take's name and the
/// method. Throws Error: bad input where the folder exists or lies within `take`, or a frame is
/// damaged; failed for the disk or when stopped; nothing is left behind then.
RetimeReport retime_take(const Take& take, const Timeline& timeline,
                         const std::vector<std::vector<Nanoseconds>>& times,
                         const RetimeSettings& settings, const std::filesystem::path& folder,
                         const std::string& created_by, const std::function<void(double)>& progress,
                         const std::stop_token& stop);

}  // namespace raystage
