// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <list>
#include <memory>
#include <mutex>
#include <string>

#include "replay/scene.h"

namespace raystage::replay {

/// Open scenes, shared by the pages that show the same layers. The least recently used is closed if
/// there are too many, so that their memory is bounded. Thread-safe.
class SceneCache {
 public:
  /// `memory_bytes`: of all scenes; 0: half of available_memory().
  SceneCache(std::filesystem::path cache_folder, std::size_t memory_bytes);

  /// Returns the scene of a shot, whatever its camera. Throws Error (bad input) as Scene.
  std::shared_ptr<const Scene> open(const schemas::ShotDocument& shot,
                                    const std::filesystem::path& shot_file);

 private:
  struct Entry {
    std::string key;
    std::shared_ptr<const Scene> scene;
  };
  SceneOptions options_;
  std::mutex mutex_;          // guards entries_
  std::list<Entry> entries_;  ///< the most recently used first
};

}  // namespace raystage::replay
