// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "schemas/farm_job_document.h"

namespace raystage::farm {

/// How frames are cut into tasks.
struct ChunkSettings {
  int frames_per_chunk = 1;
  bool preview_first = false;  ///< every tenth frame goes into the first chunks
};

/// Frames of each chunk in the order of their tasks, which is the order in which a scheduler starts
/// them. `frames` are sorted and distinct. Every frame is in exactly one chunk.
std::vector<std::vector<int>> split_into_chunks(std::span<const int> frames,
                                                const ChunkSettings& settings);

/// Frames per chunk such that a task lasts about five minutes, while a job of more than half a
/// minute keeps at least 16 tasks to share out. `seconds_per_frame`: wall-clock, of one task; none:
/// unknown.
int automatic_chunk_size(std::size_t frames, std::optional<double> seconds_per_frame);

/// Chunks that wait for the same tasks of stage prepare.
struct ChunkGroup {
  std::vector<int> instants;  ///< indices, sorted; tasks of this round only
  std::vector<int> chunks;    ///< indices, sorted
};

/// The chunks of a round by what they wait for; instants that are not prepared in this round are
/// left out. One submission for each group, so that a chunk waits only for its instants; where
/// there would be more than 100, neighbouring groups wait together.
std::vector<ChunkGroup> group_chunks(const FarmJobDocument& job, std::span<const int> prepare,
                                     std::span<const int> render);

/// A part of an array: task `i` of Slurm, of `indices`, is task `i + offset` of the stage.
struct ArrayPart {
  int offset = 0;
  std::vector<int> indices;  ///< without the offset: 0 to the largest array index
};

/// Cuts sorted indices so that each part's indices lie in [0, max_array_size).
std::vector<ArrayPart> split_array(std::span<const int> indices, int max_array_size);

}  // namespace raystage::farm
