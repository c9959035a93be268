// SPDX-License-Identifier: Apache-2.0
// Caches the depths of this host's cameras for the last kLocalDepthFrames light field frames.
// Missing ones are estimated together with the other hosts (estimate_local_depths() in
// camera_depths.cpp) and quantised as in a depth file. Cost: the estimation, once per light field
// frame.
#include "render/depth/local_depths.h"

#include <algorithm>
#include <deque>
#include <mutex>
#include <utility>

#include "render/depth/depth_file.h"
#include "render/depth/imported_depths.h"

namespace raystage::render::depth {
namespace {

/// The depths of the last light field frames of a renderer, the newest first. Hosts must drop the
/// same ones, so the limit is a number of frames, not the memory that each host has left.
class RecentDepths {
 public:
  using Entry = std::pair<std::string, std::shared_ptr<const NotedDepths>>;

  std::shared_ptr<const NotedDepths> find(const std::string& key) const {
    const std::scoped_lock lock(mutex_);
    const auto found = std::ranges::find(entries_, key, &Entry::first);
    if (found == entries_.end()) return nullptr;
    std::rotate(entries_.begin(), found, found + 1);
    return entries_.front().second;
  }
  void add(const std::string& key, std::shared_ptr<const NotedDepths> depths) const {
    const std::scoped_lock lock(mutex_);
    entries_.emplace_front(key, std::move(depths));
    if (entries_.size() > kLocalDepthFrames) entries_.pop_back();
  }

 private:
  mutable std::mutex mutex_;
  mutable std::deque<Entry> entries_;
};

}  // namespace

std::shared_ptr<const NotedDepths> local_depths(const ViewRequest& request,
                                                const DepthViewOptions& options,
                                                const RankCommunicator& group) {
  const auto recent = request.result_cache.get<RecentDepths>(
      "depths of this host's cameras", [](std::size_t& bytes) {
        bytes = 0;  // never dropped
        return std::make_shared<const RecentDepths>();
      });
  const std::string key = depth_cache_key(request.instant, options.estimation);
  if (auto found = recent->find(key)) return found;
  auto made = std::make_shared<NotedDepths>();
  made->depths =
      estimate_local_depths(request.instant, options.estimation, request.working_bytes, group);
  for (InverseDepthMap& map : made->depths.maps) quantise_depths(map);
  made->notes = depth_notes(made->depths, request.instant, options.estimation);
  // All hosts estimate, as they must do it together, whatever maps each of them can read.
  const auto imported = ImportedDepths::of(*request.instant.take, request.result_cache);
  if (imported->replace(request.instant, options.estimation, made->depths)) {
    made->notes.emplace_back(kImportedDepthsNote);
  }
  made->depths.compute_block_nearest();
  recent->add(key, made);
  return made;
}

}  // namespace raystage::render::depth
