// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

namespace raystage::replay {

/// Pictures that wait for a slow connection: the newest one of each stream. Not thread-safe.
class PictureQueue {
 public:
  /// Adds the answer to the request `request` of a stream; numbers of requests grow. It replaces
  /// the picture of the stream that waits. Drops it if a newer request of the stream has a picture
  /// already, because threads that render at once may end in any order.
  void push(int stream, std::int64_t request, std::vector<std::byte> message);

  /// Returns a picture that waits, and removes it; nullopt: there is none.
  std::optional<std::vector<std::byte>> pop();

  void clear() { waiting_.clear(); }

  /// Returns the pictures that were replaced or dropped.
  std::int64_t dropped() const { return dropped_; }

 private:
  std::map<int, std::vector<std::byte>> waiting_;  ///< by stream
  std::map<int, std::int64_t> newest_;             ///< request, by stream
  std::int64_t dropped_ = 0;
};

}  // namespace raystage::replay
