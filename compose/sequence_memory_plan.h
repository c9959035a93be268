// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "compose/shot_plan.h"

namespace raystage::compose {

/// Returns "12.3 MB" or "1.23 GB" (10^6 and 10^9 bytes).
std::string format_byte_size(double bytes);

/// Returns the size of a frame's files without compression, bytes; with both eyes of stereo shots.
std::size_t uncompressed_file_bytes(const ShotPlan& plan, bool deep);

/// Largest number of finished frames that wait for the disk, in addition to the one being written.
inline constexpr std::size_t kMaxQueuedFrames = 1;

/// Memory budget of a sequence and what it is for.
struct MemoryRequest {
  std::size_t bytes = 0;     ///< 0: half of available_memory(), at most 4 GiB of it for the cache
  int frames_in_flight = 0;  ///< 0: one per thread of the TBB arena, at most 16
  bool deep = false;         ///< as SequenceOptions
};

/// Memory budgets of a sequence, bytes. Those of the base are the sums over all light fields.
struct SequenceMemoryPlan : LightFieldMemory {
  int frames_in_flight = 1;
  std::vector<LightFieldMemory> per_layer;  ///< 0 for layers without a visible light field
  std::string note;  ///< for the log: why a view may exceed the budget; empty: none may
};

/// Returns the memory of `frames_in_flight` frames with all decoded source frames that they may use
/// at once, bytes; without the methods' result caches and working memory.
std::size_t required_memory(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                            std::size_t frames_in_flight, bool deep);

/// Returns as many frames in flight as fit, with the decoded source frames that their views may use
/// at once. The rest is divided equally among the light fields, each part by split_memory_budget().
/// Throws Error (bad input) if not even one frame fits.
SequenceMemoryPlan plan_sequence_memory(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                                        const MemoryRequest& request);

}  // namespace raystage::compose
