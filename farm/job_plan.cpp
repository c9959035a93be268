// SPDX-License-Identifier: Apache-2.0
// Splits the frames of a job into chunks, groups chunks by the instants that they depend on, and
// splits task indices into Slurm arrays. Inputs and outputs are frame numbers and task indices.
// Every frame is in one chunk; there are at most kMaxGroups groups. Cost: n log n in chunks.
#include "farm/job_plan.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "base/options.h"

namespace raystage::farm {
namespace {

constexpr int kPreviewStep = 10;
constexpr double kSecondsPerTask = 300, kWorthSharing = 30;
constexpr int kMinTasks = 16;
constexpr std::size_t kMaxGroups = 100;

void append_chunks(std::span<const int> frames, int per_chunk,
                   std::vector<std::vector<int>>& chunks) {
  const auto step = static_cast<std::size_t>(std::max(1, per_chunk));
  for (std::size_t begin = 0; begin < frames.size(); begin += step) {
    const auto part = frames.subspan(begin, std::min(step, frames.size() - begin));
    chunks.emplace_back(part.begin(), part.end());
  }
}

/// Merges adjacent groups until at most kMaxGroups are left: each group is a call of sbatch.
std::vector<ChunkGroup> merged(std::vector<ChunkGroup> groups) {
  if (groups.size() <= kMaxGroups) return groups;
  std::vector<ChunkGroup> result;
  const std::size_t step = (groups.size() + kMaxGroups - 1) / kMaxGroups;
  for (std::size_t i = 0; i < groups.size(); ++i) {
    if (i % step == 0) result.emplace_back();
    ChunkGroup& group = result.back();
    group.instants.insert(group.instants.end(), groups[i].instants.begin(),
                          groups[i].instants.end());
    group.chunks.insert(group.chunks.end(), groups[i].chunks.begin(), groups[i].chunks.end());
  }
  for (ChunkGroup& group : result) {
    std::ranges::sort(group.chunks);
    std::ranges::sort(group.instants);
    const auto doubles = std::unique(group.instants.begin(), group.instants.end());
    group.instants.erase(doubles, group.instants.end());
  }
  return result;
}

}  // namespace

bool ChunkOptions::is_valid(std::string* reason) const {
  return is_within("frames per chunk", frames_per_chunk, 1, 1e9, reason);
}

std::vector<std::vector<int>> split_into_chunks(std::span<const int> frames,
                                                const ChunkOptions& options) {
  require_valid(options, "chunks");
  std::vector<std::vector<int>> chunks;
  if (!options.preview_first) {
    append_chunks(frames, options.frames_per_chunk, chunks);
    return chunks;
  }
  std::vector<int> first, rest;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    (i % kPreviewStep == 0 ? first : rest).push_back(frames[i]);
  }
  append_chunks(first, options.frames_per_chunk, chunks);
  append_chunks(rest, options.frames_per_chunk, chunks);
  return chunks;
}

int automatic_chunk_size(std::size_t frames, std::optional<double> seconds_per_frame) {
  const auto count = static_cast<double>(std::max<std::size_t>(frames, 1));
  if (!seconds_per_frame) return static_cast<int>(std::min(count, 10.0));
  const double seconds = std::max(*seconds_per_frame, 1e-3);
  double chunk = std::clamp(std::floor(kSecondsPerTask / seconds), 1.0, count);
  if (count * seconds > kWorthSharing) {
    chunk = std::min(chunk, std::max(1.0, std::floor(count / kMinTasks)));
  }
  return static_cast<int>(chunk);
}

std::vector<ChunkGroup> group_chunks(const schemas::FarmJobDocument& job,
                                     std::span<const int> prepare, std::span<const int> render) {
  std::map<std::vector<int>, std::vector<int>> groups;
  for (const int chunk : render) {
    std::vector<int> waits;
    for (const int instant : job.chunks[chunk].instants) {
      if (std::ranges::binary_search(prepare, instant)) waits.push_back(instant);
    }
    std::ranges::sort(waits);
    groups[waits].push_back(chunk);
  }
  std::vector<ChunkGroup> result;
  for (auto& [instants, chunks] : groups) result.push_back({instants, chunks});
  // Sort groups by their first chunk, so that previews stay first.
  std::ranges::sort(result, {}, [](const ChunkGroup& group) { return group.chunks.front(); });
  return merged(std::move(result));
}

std::vector<ArrayPart> split_array(std::span<const int> indices, int max_array_size) {
  std::vector<ArrayPart> parts;
  for (const int index : indices) {
    const int offset = index / max_array_size * max_array_size;
    if (parts.empty() || parts.back().offset != offset) parts.push_back({offset, {}});
    parts.back().indices.push_back(index - offset);
  }
  return parts;
}

}  // namespace raystage::farm
