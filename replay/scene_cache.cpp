// SPDX-License-Identifier: Apache-2.0
#include "replay/scene_cache.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "base/resources.h"

namespace raystage::replay {
namespace {

constexpr std::size_t kMaxScenes = 3;
/// A scene with a smaller part of the usual budget is not opened.
constexpr std::size_t kLeastShare = 8;

std::string shot_memory_text(std::size_t bytes) {
  return fmt::format("{:.1f} GB in all", static_cast<double>(bytes) * 1e-9);
}

/// Returns what a scene depends on: all of the shot but its camera.
std::string key_of(schemas::ShotDocument shot, const std::filesystem::path& shot_file) {
  shot.camera = {};
  shot.camera.keys = {{.frame = 0}};
  return shot_file.parent_path().string() + '\n' + schemas::format_shot(shot);
}

}  // namespace

SceneCache::SceneCache(std::filesystem::path cache_folder, std::size_t memory_bytes)
    : cache_folder_(std::move(cache_folder)),
      memory_bytes_(memory_bytes > 0 ? memory_bytes : available_memory() / 2) {}

std::shared_ptr<const Scene> SceneCache::open(const schemas::ShotDocument& shot,
                                              const std::filesystem::path& shot_file) {
  std::string key = key_of(shot, shot_file);
  // Opened under the lock: the memory of a scene is what the others leave.
  const std::scoped_lock lock(mutex_);
  const auto known = std::ranges::find(entries_, key, &Entry::key);
  if (known != entries_.end()) {
    entries_.splice(entries_.begin(), entries_, known);
    return entries_.front().scene;
  }
  // Closed before another one is opened, unless a page shows it.
  while (entries_.size() >= kMaxScenes) entries_.pop_back();
  const std::size_t budget = next_budget();
  auto scene = std::make_shared<const Scene>(shot, shot_file, SceneOptions{cache_folder_, budget});
  budgets_.push_back({scene, budget});
  entries_.push_front({std::move(key), scene});
  return scene;
}

std::size_t SceneCache::next_budget() {
  std::erase_if(budgets_, [](const Budget& one) { return one.scene.expired(); });
  std::size_t used = 0;
  for (const Budget& one : budgets_) used += one.bytes;
  const std::size_t left = memory_bytes_ - std::min(used, memory_bytes_);
  // A page that is alone gets a third; each further page that shows something else gets less.
  const std::size_t budget = std::min(memory_bytes_ / kMaxScenes, left / 2);
  if (budget < memory_bytes_ / (kMaxScenes * kLeastShare)) {
    throw Error::failed(
        fmt::format("the memory of the viewer is in use by {} other shots", budgets_.size()),
        shot_memory_text(memory_bytes_), "Close other pages, or state more memory");
  }
  return budget;
}

}  // namespace raystage::replay
