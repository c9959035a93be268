// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "replay/scene.h"

namespace raystage::replay {

/// Open scenes, shared by the pages that show the same layers. The least recently used is closed if
/// there are too many. Their memory together is bounded, whatever pages still show. Thread-safe.
class SceneCache {
 public:
  /// `memory_bytes`: of all scenes; 0: half of available_memory().
  SceneCache(std::filesystem::path cache_folder, std::size_t memory_bytes);

  /// Returns the scene of a shot, whatever its camera. Throws Error (bad input) as Scene, and
  /// (failed) if other scenes that pages show use the memory.
  std::shared_ptr<const Scene> open(const schemas::ShotDocument& shot,
                                    const std::filesystem::path& shot_file);

 private:
  struct Entry {
    std::string key;
    std::shared_ptr<const Scene> scene;
  };
  /// Memory of a scene that may still be shown.
  struct Budget {
    std::weak_ptr<const Scene> scene;
    std::size_t bytes = 0;
  };
  /// Returns the memory for one more scene. Throws Error (failed) if too little is left.
  std::size_t next_budget();

  std::filesystem::path cache_folder_;
  std::size_t memory_bytes_;
  std::mutex mutex_;          // guards the members below
  std::list<Entry> entries_;  ///< the most recently used first
  std::vector<Budget> budgets_;
};

}  // namespace raystage::replay
