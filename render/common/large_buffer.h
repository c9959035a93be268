// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <type_traits>
#include <vector>

namespace raystage {

/// Memory that one matching leaves to the next: a fresh block costs as long as a tenth of the
/// matching, in which the kernel clears it. Holds never more than was in use at once: where no free
/// block is of the size wanted, all that are free go. For many threads; outlives its buffers.
class BufferPool {
 public:
  BufferPool() = default;
  ~BufferPool();
  BufferPool(const BufferPool&) = delete;
  BufferPool& operator=(const BufferPool&) = delete;

  /// `bytes` as of block_bytes(). Throws std::bad_alloc.
  void* take(std::size_t bytes);
  void return_block(void* block, std::size_t bytes) noexcept;
  /// Frees what is not in use.
  void release() noexcept;
  std::size_t free_bytes() const;

 private:
  struct Block {
    void* data;
    std::size_t bytes;
  };
  mutable std::mutex mutex_;
  std::vector<Block> free_;
};

namespace memory_block {

/// What is taken for so many: large ones are whole pages of 2 MB.
std::size_t rounded(std::size_t bytes);
/// From the pool, or fresh where there is none. Throws std::bad_alloc.
void* take(std::size_t bytes, BufferPool* pool);

struct BlockDeleter {
  std::size_t bytes = 0;
  BufferPool* pool = nullptr;
  void operator()(void* block) const noexcept;
};

}  // namespace memory_block

/// Uninitialised numbers by the megabyte. In pages of 2 MB where the system has them: with small
/// ones a fifth of a matching's time goes to the first touch of each.
template <class T>
class LargeBuffer {
  static_assert(std::is_trivial_v<T>);

 public:
  LargeBuffer() = default;
  /// Throws std::bad_alloc. `pool`: where the memory comes from and goes to, or null.
  explicit LargeBuffer(std::size_t count, BufferPool* pool = nullptr)
      : data_(static_cast<T*>(memory_block::take(bytes(count), pool)), {bytes(count), pool}) {}
  /// Memory that so many take.
  static std::size_t bytes(std::size_t count) { return memory_block::rounded(count * sizeof(T)); }
  T* data() const { return data_.get(); }

 private:
  std::unique_ptr<T, memory_block::BlockDeleter> data_;
};

}  // namespace raystage
