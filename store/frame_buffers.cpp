// SPDX-License-Identifier: Apache-2.0
#include "store/frame_buffers.h"

#include <algorithm>
#include <utility>

namespace raystage::store {
namespace {

constexpr std::size_t kMaxSpare = 16;  // about the number of threads that decode
constexpr std::size_t kMaxSpareBytes = std::size_t{8} << 20;  // of a buffer
constexpr std::size_t kRounding = std::size_t{1} << 16;       // sizes of frames vary

}  // namespace

std::shared_ptr<std::byte[]> FrameBuffers::take(std::size_t bytes) {
  Buffer buffer;
  {
    const std::scoped_lock lock(mutex_);
    const auto fits =
        std::ranges::find_if(spare_, [&](const Buffer& b) { return b.bytes >= bytes; });
    if (fits != spare_.end()) {
      buffer = std::move(*fits);
      spare_.erase(fits);
    }
  }
  if (!buffer.data) {
    buffer.bytes = (bytes / kRounding + 1) * kRounding;
    buffer.data = std::make_unique_for_overwrite<std::byte[]>(buffer.bytes);
  }
  const std::size_t held = buffer.bytes;
  return {buffer.data.release(), [weak = weak_from_this(), held](std::byte* data) {
            Buffer back{std::unique_ptr<std::byte[]>(data), held};
            if (const auto self = weak.lock()) self->give_back(std::move(back));
          }};
}

void FrameBuffers::give_back(Buffer buffer) {
  if (buffer.bytes > kMaxSpareBytes) return;
  const std::scoped_lock lock(mutex_);
  if (spare_.size() >= kMaxSpare) spare_.erase(spare_.begin());
  spare_.push_back(std::move(buffer));
}

}  // namespace raystage::store
