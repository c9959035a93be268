// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "schemas/farm_job_document.h"

namespace raystage::farm {

/// How frames are split into chunks.
struct ChunkOptions {
  int frames_per_chunk = 1;
  bool preview_first = false;  ///< put every tenth frame into the first chunks
  bool is_valid(std::string* reason) const;
};

/// Returns the frames of each chunk, in the order of the tasks, in which a scheduler starts them.
/// `frames` are sorted and distinct. Every frame is in exactly one chunk.
std::vector<std::vector<int>> split_into_chunks(std::span<const int> frames,
                                                const ChunkOptions& options);

/// Returns the frames per chunk with which a task takes about five minutes, while a job of more
/// than half a minute keeps at least 16 tasks. `seconds_per_frame` is the wall-clock time within
/// one task; nothing if unknown.
int automatic_chunk_size(std::size_t frames, std::optional<double> seconds_per_frame);

/// Chunks that depend on the same tasks of stage prepare.
struct ChunkGroup {
  std::vector<int> instants;  ///< indices, sorted; tasks of this round only
  std::vector<int> chunks;    ///< indices, sorted
};

/// Groups the chunks of a round by the instants that they depend on. Instants that are not prepared
/// in this round are ignored. Each group is one array, so that a chunk waits only for its own
/// instants. If there are more than 100 groups, adjacent groups are merged.
std::vector<ChunkGroup> group_chunks(const schemas::FarmJobDocument& job,
                                     std::span<const int> prepare, std::span<const int> render);

/// A part of an array: array index `i` of Slurm is task `i + offset` of the stage.
struct ArrayPart {
  int offset = 0;
  std::vector<int> indices;  ///< array indices: 0 to the largest that Slurm allows
};

/// Splits sorted task indices into parts whose array indices are in [0, max_array_size).
std::vector<ArrayPart> split_array(std::span<const int> indices, int max_array_size);

}  // namespace raystage::farm
