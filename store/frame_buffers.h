// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <vector>

namespace raystage::store {

/// Memory for encoded frames, reused from frame to frame: fresh pages cost more than reading a
/// frame that the kernel has in its cache. Thread-safe.
class FrameBuffers : public std::enable_shared_from_this<FrameBuffers> {
 public:
  /// Returns uninitialised memory of at least `bytes`, which comes back when its last user releases
  /// it. The object must be owned by a shared_ptr.
  std::shared_ptr<std::byte[]> take(std::size_t bytes);

 private:
  struct Buffer {
    std::unique_ptr<std::byte[]> data;
    std::size_t bytes = 0;
  };
  void give_back(Buffer buffer);

  std::mutex mutex_;
  std::vector<Buffer> spare_;
};

}  // namespace raystage::store
