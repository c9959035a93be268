// SPDX-License-Identifier: Apache-2.0
#include "store/unpacked_frames.h"

#include "store/jpegxl/frame_packer.h"
#include "store/jpegxl/picture_codec.h"
#include "store/temporal/group_decoder.h"

namespace raystage::store {

UnpackedFrames::UnpackedFrames(std::size_t budget_bytes)
    : packer_(std::make_unique<const FramePacker>()),
      pictures_(std::make_unique<const PictureCodec>()),
      groups_(std::make_unique<const GroupDecoder>()),
      budget_(budget_bytes) {}
UnpackedFrames::~UnpackedFrames() = default;

std::uint64_t UnpackedFrames::new_archive() {
  const std::scoped_lock lock(mutex_);
  return archives_++;
}

std::optional<FrameBytes> UnpackedFrames::find(const Key& key) {
  const std::scoped_lock lock(mutex_);
  const auto found = entries_.find(key);
  if (found == entries_.end()) return std::nullopt;
  by_use_.splice(by_use_.begin(), by_use_, found->second.position);
  return found->second.jpeg;
}

void UnpackedFrames::insert(const Key& key, const FrameBytes& jpeg) {
  const std::scoped_lock lock(mutex_);
  if (jpeg.size() > budget_ || entries_.contains(key)) return;
  by_use_.push_front(key);
  entries_.emplace(key, Entry{jpeg, by_use_.begin()});
  held_ += jpeg.size();
  evict();
}

void UnpackedFrames::set_budget(std::size_t bytes) {
  const std::scoped_lock lock(mutex_);
  budget_ = bytes;
  evict();
}

std::size_t UnpackedFrames::bytes_held() const {
  const std::scoped_lock lock(mutex_);
  return held_;
}

void UnpackedFrames::evict() {
  while (held_ > budget_) {
    const auto oldest = entries_.find(by_use_.back());
    held_ -= oldest->second.jpeg.size();
    entries_.erase(oldest);
    by_use_.pop_back();
  }
}

}  // namespace raystage::store
