// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "compose/shot_plan.h"

namespace raystage {

/// "12.3 MB" or "1.23 GB", of 10^6 and 10^9 bytes.
std::string format_byte_size(double bytes);

/// What the files of a frame take if nothing in them is compressed, bytes; both eyes of one that
/// has two.
std::size_t uncompressed_file_bytes(const ShotPlan& plan, bool deep);

/// Finished frames that wait for the disk at most, beside the one that is being written.
inline constexpr std::size_t kMaxQueuedFrames = 1;

/// What is granted, and for what.
struct MemoryRequest {
  std::size_t bytes = 0;     ///< 0: half of available_memory(), at most 4 GiB of them for the cache
  int frames_in_flight = 0;  ///< 0: one per thread of the TBB arena, at most 16
  bool deep = false;         ///< as SequenceOptions
};

/// How a sequence shares its memory out, bytes.
struct SequenceMemoryPlan : LightFieldMemory {  ///< of all light fields together
  int frames_in_flight = 1;
  std::vector<LightFieldMemory> per_layer;  ///< 0 where a layer is no light field, or shows nothing
  /// For people: where a view may need more than is there; empty: nowhere.
  std::string note;
};

/// What so many frames in flight take, with all decoded frames that they may look through at once,
/// bytes; beside what methods keep and work in.
std::size_t required_memory(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                            std::size_t frames_in_flight, bool deep);

/// So many frames in flight as there is room for, with the decoded frames that a view may look
/// through at once; what is left in equal parts for the light fields, each by
/// split_memory_budget(). Throws Error (bad input) where not one frame fits.
SequenceMemoryPlan plan_sequence_memory(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                                        const MemoryRequest& request);

}  // namespace raystage
