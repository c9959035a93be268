// SPDX-License-Identifier: Apache-2.0
// A sorted table of all frames of the cameras whose frames refer to each other. Cost: sorting n
// frames once, 16 bytes each, then a binary search.
#include "store/frames_by_hash.h"

#include <algorithm>
#include <tuple>

#include "store/archive.h"
#include "store/camera_groups.h"

namespace raystage::store {
namespace {

std::vector<FramesByHash::Entry> sorted_frames(const TakeArchives& take) {
  std::vector<FramesByHash::Entry> entries;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    const ArchiveReader* const archive = readable_archive(take, camera);
    if (archive == nullptr || !refers_to_cameras(archive->description().codec)) continue;
    const auto frames = archive->frames();
    for (std::size_t i = 0; i < frames.size(); ++i) {
      if (frames[i].xxh3 == 0) continue;
      entries.push_back({frames[i].xxh3, camera, static_cast<std::int32_t>(i)});
    }
  }
  std::ranges::sort(entries, {}, [](const FramesByHash::Entry& entry) {
    return std::tuple(entry.xxh3, entry.camera, entry.frame);
  });
  return entries;
}

}  // namespace

std::span<const FramesByHash::Entry> FramesByHash::find(const TakeArchives& take,
                                                        std::uint64_t xxh3) const {
  if (!is_built_.load(std::memory_order_acquire)) {
    const std::scoped_lock lock(building_);
    if (!is_built_.load(std::memory_order_relaxed)) {
      entries_ = sorted_frames(take);
      is_built_.store(true, std::memory_order_release);
    }
  }
  return {std::ranges::lower_bound(entries_, xxh3, {}, &Entry::xxh3),
          std::ranges::upper_bound(entries_, xxh3, {}, &Entry::xxh3)};
}

}  // namespace raystage::store
