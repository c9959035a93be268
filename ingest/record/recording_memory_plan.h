// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "ingest/record/recorder.h"

namespace raystage::ingest {

/// RAM that a recording needs, in bytes.
struct RecordingMemoryPlan {
  std::size_t frames = 0;  ///< the limit for all frames of all cameras
  /// An upper estimate for the sources (FrameSource::memory_overhead), the encoders and the program
  /// itself. It excludes the archives' index, which grows by 16 to 32 bytes per stored frame.
  std::size_t overhead = 0;
};

/// The program with its libraries, and freed memory that the C library does not return.
inline constexpr std::size_t kProgramBytes = 64 << 20;

RecordingMemoryPlan plan_recording_memory(const RecorderOptions& options,
                                          const std::vector<RecorderCamera>& cameras);

/// Returns "RAM: 500 MB for frames, plus up to about 120 MB for ...".
std::string format_memory_plan(const RecordingMemoryPlan& plan);

/// Throws Error (bad input) if `frames` exceed the RAM of the machine. Both in bytes.
void check_recording_memory(std::size_t frames, std::size_t machine);

/// Throws Error (bad input) if a recording may need more than its process may take (bytes).
void check_memory_ceiling(const RecordingMemoryPlan& plan, std::size_t ceiling);

/// Returns a warning if the plan needs more than 80 % of the free RAM (in bytes), otherwise an
/// empty text.
std::string memory_warning(const RecordingMemoryPlan& plan, std::size_t free_now);

}  // namespace raystage::ingest
