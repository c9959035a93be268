// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/frame_queue.h"

#include <algorithm>
#include <cassert>
#include <iterator>
#include <utility>

namespace raystage::ingest {

void QueuedFrame::mark_missing(store::FrameStatus reason) {
  stage = Stage::kReady;
  status = reason;
  raw = {};
  jpeg = {};
  memory.shrink_to(kMissingRecordBytes);
}

void FrameQueue::push(Frame frame) {
  const std::scoped_lock lock(mutex_);
  assert(frames_.empty() || frames_.back()->time_ns < frame->time_ns);
  if (frame->stage == QueuedFrame::Stage::kToEncode) {
    to_encode_.push_back(frame);
    ++waiting_;
  }
  frames_.push_back(std::move(frame));
}

bool FrameQueue::needs_encoder() {
  const std::scoped_lock lock(mutex_);
  if (encoders_requested_ >= waiting_) return false;
  ++encoders_requested_;
  return true;
}

FrameQueue::Frame FrameQueue::start_encoding() {
  const std::scoped_lock lock(mutex_);
  if (encoders_requested_ > 0) --encoders_requested_;
  while (!to_encode_.empty()) {
    const Frame frame = std::move(to_encode_.front());
    to_encode_.pop_front();
    if (frame->stage != QueuedFrame::Stage::kToEncode) continue;  // dropped meanwhile
    frame->stage = QueuedFrame::Stage::kEncoding;
    --waiting_;
    return frame;
  }
  return nullptr;
}

void FrameQueue::finish_encoding(const Frame& frame, std::optional<std::vector<std::byte>> jpeg) {
  store::RawImage done;  // freed outside of the lock
  const std::scoped_lock lock(mutex_);
  assert(frame->stage == QueuedFrame::Stage::kEncoding);
  if (!jpeg) {
    frame->mark_missing(store::FrameStatus::kDroppedEncoder);
    ++encoder_failures_;
    return;
  }
  std::swap(done, frame->raw);
  frame->jpeg = std::move(*jpeg);
  frame->stage = QueuedFrame::Stage::kReady;
  frame->memory.shrink_to(frame->jpeg.capacity() + kMissingRecordBytes);
}

std::vector<FrameQueue::Frame> FrameQueue::start_writing(std::size_t max_frames) {
  std::vector<Frame> ready;
  const std::scoped_lock lock(mutex_);
  for (const Frame& frame : frames_) {
    if (ready.size() == max_frames || frame->stage != QueuedFrame::Stage::kReady) break;
    ready.push_back(frame);
  }
  writing_ = ready.size();
  return ready;
}

void FrameQueue::finish_writing(std::size_t written) {
  const std::scoped_lock lock(mutex_);
  assert(written <= writing_);
  // The images are freed outside of the lock, with the writer's own references.
  frames_.erase(frames_.begin(), frames_.begin() + static_cast<std::ptrdiff_t>(written));
  writing_ = 0;
}

bool FrameQueue::drop_one(bool oldest, store::FrameStatus reason) {
  const std::scoped_lock lock(mutex_);
  const auto waits = [](const Frame& frame) {
    return frame->has_image() && frame->stage != QueuedFrame::Stage::kEncoding;
  };
  // The first frame is never dropped, because it is the next to be written.
  const std::size_t kept = std::min(frames_.size(), std::max<std::size_t>(writing_, 1));
  const auto first = frames_.begin() + static_cast<std::ptrdiff_t>(kept);
  const auto newest = [&] {
    const auto found = std::find_if(frames_.rbegin(), std::make_reverse_iterator(first), waits);
    return found.base() == first ? frames_.end() : std::prev(found.base());
  };
  const auto found = oldest ? std::find_if(first, frames_.end(), waits) : newest();
  if (found == frames_.end()) return false;
  if ((*found)->stage == QueuedFrame::Stage::kToEncode) --waiting_;
  (*found)->mark_missing(reason);
  return true;
}

bool FrameQueue::empty() const {
  const std::scoped_lock lock(mutex_);
  return frames_.empty();
}

std::size_t FrameQueue::size() const {
  const std::scoped_lock lock(mutex_);
  return frames_.size();
}

}  // namespace raystage::ingest
