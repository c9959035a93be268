// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <span>
#include <vector>

namespace raystage::store {

class TakeArchives;

/// Finds frames that refer to other cameras, or to which others refer, by the XXH3 of their stored
/// bytes that the journals state. Thread-safe.
class FramesByHash {
 public:
  struct Entry {
    std::uint64_t xxh3 = 0;
    std::int32_t camera = 0, frame = 0;
  };

  /// Returns the frames of that XXH3, by camera and frame. The first call reads the frame tables of
  /// all archives; those that cannot be read have no frames. Throws Error (failed) if an archive is
  /// on another host.
  std::span<const Entry> find(const TakeArchives& take, std::uint64_t xxh3) const;

 private:
  // Not std::call_once: see Take::State::archive().
  mutable std::mutex building_;
  mutable std::atomic<bool> is_built_ = false;
  mutable std::vector<Entry> entries_;  // sorted; frames without a recorded XXH3 are left out
};

}  // namespace raystage::store
