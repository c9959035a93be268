// SPDX-License-Identifier: Apache-2.0
#include "replay/scene_cache.h"

#include <algorithm>
#include <utility>

#include "base/resources.h"

namespace raystage::replay {
namespace {

constexpr std::size_t kMaxScenes = 3;

/// Returns what a scene depends on: all of the shot but its camera.
std::string key_of(schemas::ShotDocument shot, const std::filesystem::path& shot_file) {
  shot.camera = {};
  shot.camera.keys = {{.frame = 0}};
  return shot_file.parent_path().string() + '\n' + schemas::format_shot(shot);
}

}  // namespace

SceneCache::SceneCache(std::filesystem::path cache_folder, std::size_t memory_bytes)
    : options_{std::move(cache_folder),
               (memory_bytes > 0 ? memory_bytes : available_memory() / 2) / kMaxScenes} {}

std::shared_ptr<const Scene> SceneCache::open(const schemas::ShotDocument& shot,
                                              const std::filesystem::path& shot_file) {
  std::string key = key_of(shot, shot_file);
  {
    const std::scoped_lock lock(mutex_);
    const auto known = std::ranges::find(entries_, key, &Entry::key);
    if (known != entries_.end()) {
      entries_.splice(entries_.begin(), entries_, known);
      return entries_.front().scene;
    }
    // Closed before another one is opened, unless a page renders it.
    while (entries_.size() >= kMaxScenes) entries_.pop_back();
  }
  auto scene = std::make_shared<const Scene>(shot, shot_file, options_);
  const std::scoped_lock lock(mutex_);
  entries_.push_front({std::move(key), scene});
  return scene;
}

}  // namespace raystage::replay
