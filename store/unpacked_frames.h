// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "store/remote_frames.h"

namespace raystage::store {

class FramePacker;
class PictureCodec;
class GroupDecoder;

/// The JPEGs of packed frames that were unpacked, within a memory budget; the least recently used
/// are evicted first. Unpacking takes far longer than reading, and views of one instant need the
/// same frames. Thread-safe.
class UnpackedFrames {
 public:
  explicit UnpackedFrames(std::size_t budget_bytes = kDefaultBudget);
  ~UnpackedFrames();
  UnpackedFrames(const UnpackedFrames&) = delete;
  UnpackedFrames& operator=(const UnpackedFrames&) = delete;

  /// Unpacks the frames of all archives, which so share its processes.
  const FramePacker& packer() const { return *packer_; }
  /// Decodes pictures of more than 8 bits, likewise.
  const PictureCodec& pictures() const { return *pictures_; }
  /// Decodes the temporal frames of all archives, likewise.
  const GroupDecoder& groups() const { return *groups_; }

  /// Names an archive and a frame in it.
  using Key = std::pair<std::uint64_t, int>;
  /// Returns a number for an archive that differs from all others.
  std::uint64_t new_archive();

  /// Returns the mutex of threads that want frames of one group: the first decodes it, the others
  /// wait. `group`: a number of the group; others may share the mutex.
  std::mutex& group_mutex(std::uint64_t group) { return groups_in_work_[group % kGroupMutexes]; }

  std::optional<FrameBytes> find(const Key& key);
  /// Keeps a frame, unless it is larger than the budget.
  void insert(const Key& key, const FrameBytes& jpeg);
  /// Changes the budget, bytes; evicts what exceeds it.
  void set_budget(std::size_t bytes);
  std::size_t bytes_held() const;

  static constexpr std::size_t kDefaultBudget = std::size_t{64} << 20;

 private:
  struct Entry {
    FrameBytes jpeg;
    std::list<Key>::iterator position;
  };
  void evict();

  const std::unique_ptr<const FramePacker> packer_;
  const std::unique_ptr<const PictureCodec> pictures_;
  const std::unique_ptr<const GroupDecoder> groups_;
  static constexpr std::size_t kGroupMutexes = 64;
  std::array<std::mutex, kGroupMutexes> groups_in_work_;
  mutable std::mutex mutex_;
  std::map<Key, Entry> entries_;
  std::list<Key> by_use_;  // the latest first
  std::size_t budget_, held_ = 0;
  std::uint64_t archives_ = 0;
};

}  // namespace raystage::store
