// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "ingest/record/recorder.h"

namespace raystage {

/// What a recording takes of the machine's RAM, bytes.
struct RecordingMemoryPlan {
  std::size_t frames = 0;  ///< the limit for all frames of all cameras
  /// An estimate from above: the sources (FrameSource::memory_overhead), the encoders, and the
  /// program itself. What grows with the length of the recording is not in it: 16 to 32 bytes for
  /// each frame stored, the archives' index.
  std::size_t overhead = 0;
};

/// The program with its libraries, and with the leftovers of freed memory that the C library keeps.
inline constexpr std::size_t kProgramBytes = 64 << 20;

RecordingMemoryPlan plan_recording_memory(const RecorderSettings& settings,
                                          const std::vector<RecorderCamera>& cameras);

/// "RAM: 500 MB for frames; beside it up to about 120 MB for ...".
std::string format_memory_plan(const RecordingMemoryPlan& plan);

/// Throws Error (bad input) where the frames may take more than the machine has. Both in bytes.
void check_recording_memory(std::size_t frames, std::size_t machine);

/// A sentence where the plan needs more than 80 % of what is free now, bytes; else empty.
std::string memory_warning(const RecordingMemoryPlan& plan, std::size_t free_now);

}  // namespace raystage
