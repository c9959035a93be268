// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mutex>
#include <set>
#include <string>
#include <vector>

namespace raystage::compose {

/// Collects the ids of cameras that are absent from a frame of the shot because their stored frames
/// are rotten. Thread-safe.
class RottenCameras {
 public:
  void add(const std::string& id) {
    const std::scoped_lock lock(mutex_);
    ids_.insert(id);
  }
  /// Returns the ids in alphabetical order.
  std::vector<std::string> ids() const {
    const std::scoped_lock lock(mutex_);
    return {ids_.begin(), ids_.end()};
  }

 private:
  mutable std::mutex mutex_;
  std::set<std::string> ids_;
};

}  // namespace raystage::compose
