// SPDX-License-Identifier: Apache-2.0
#include "base/large_buffer.h"

#include <sys/mman.h>

#include <algorithm>
#include <cstdlib>
#include <new>

namespace raystage {
namespace memory_block {
namespace {

constexpr std::size_t kPage = std::size_t{1} << 21;

bool is_large(std::size_t bytes) { return bytes >= 2 * kPage; }

}  // namespace

std::size_t rounded(std::size_t bytes) {
  return is_large(bytes) ? (bytes + kPage - 1) / kPage * kPage : bytes;
}

void* take(std::size_t bytes, BufferPool* pool) {
  if (pool != nullptr) return pool->take(bytes);
  void* block = is_large(bytes) ? std::aligned_alloc(kPage, bytes)
                                : std::malloc(bytes);  // NOLINT: LargeBuffer's at once
  if (block == nullptr && bytes > 0) throw std::bad_alloc();
  // Failure is harmless: this is only a hint.
  if (is_large(bytes)) madvise(block, bytes, MADV_HUGEPAGE);
  return block;
}

void BlockDeleter::operator()(void* block) const noexcept {
  if (pool != nullptr) {
    pool->return_block(block, bytes);
  } else {
    std::free(block);  // NOLINT: from take()
  }
}

}  // namespace memory_block

BufferPool::~BufferPool() { release(); }

void BufferPool::release() noexcept {
  const std::lock_guard lock(mutex_);
  for (const Block& block : free_) std::free(block.data);  // NOLINT: from memory_block::take()
  free_.clear();
}

void* BufferPool::take(std::size_t bytes) {
  {
    const std::lock_guard lock(mutex_);
    const auto fits = std::ranges::find(free_, bytes, &Block::bytes);
    if (fits != free_.end()) {
      void* const data = fits->data;
      free_.erase(fits);
      return data;
    }
  }
  release();
  return memory_block::take(bytes, nullptr);
}

void BufferPool::return_block(void* block, std::size_t bytes) noexcept {
  if (block == nullptr) return;
  try {
    const std::lock_guard lock(mutex_);
    free_.push_back({block, bytes});
  } catch (...) {
    std::free(block);  // NOLINT: as above
  }
}

std::size_t BufferPool::free_bytes() const {
  const std::lock_guard lock(mutex_);
  std::size_t bytes = 0;
  for (const Block& block : free_) bytes += block.bytes;
  return bytes;
}

}  // namespace raystage
