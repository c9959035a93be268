// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <type_traits>
#include <vector>

namespace raystage {

/// A pool of memory blocks that one matching leaves to the next. The kernel clears fresh blocks,
/// which takes a tenth of the time of a matching. The pool never holds more memory than was in use
/// at once: if no free block has the requested size, all free blocks are released. Thread-safe;
/// must outlive its buffers.
class BufferPool {
 public:
  BufferPool() = default;
  ~BufferPool();
  BufferPool(const BufferPool&) = delete;
  BufferPool& operator=(const BufferPool&) = delete;

  /// Allocates `bytes`. Throws std::bad_alloc.
  void* take(std::size_t bytes);
  void return_block(void* block, std::size_t bytes) noexcept;
  /// Frees the blocks that are not in use.
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

/// Returns the bytes allocated for a request: large blocks are whole pages of 2 MB.
std::size_t rounded(std::size_t bytes);
/// Allocates from the pool, or from the system if `pool` is null. Throws std::bad_alloc.
void* take(std::size_t bytes, BufferPool* pool);

struct BlockDeleter {
  std::size_t bytes = 0;
  BufferPool* pool = nullptr;
  void operator()(void* block) const noexcept;
};

}  // namespace memory_block

/// An uninitialised array of megabytes of numbers, in pages of 2 MB where the system has them. With
/// small pages a fifth of a matching's time is spent on the first access to each page.
template <class T>
class LargeBuffer {
  static_assert(std::is_trivial_v<T>);

 public:
  LargeBuffer() = default;
  /// Throws std::bad_alloc. `pool`: allocates and takes back the memory; null: the system does.
  explicit LargeBuffer(std::size_t count, BufferPool* pool = nullptr)
      : data_(static_cast<T*>(memory_block::take(bytes(count), pool)), {bytes(count), pool}) {}
  /// Returns the memory that `count` elements need.
  static std::size_t bytes(std::size_t count) { return memory_block::rounded(count * sizeof(T)); }
  T* data() const { return data_.get(); }

 private:
  std::unique_ptr<T, memory_block::BlockDeleter> data_;
};

}  // namespace raystage
