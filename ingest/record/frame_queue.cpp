// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/frame_queue.h"

#include <algorithm>
#include <cassert>
#include <utility>

namespace raystage {

void QueuedFrame::become_missing(FrameStatus reason) {
  stage = Stage::kReady;
  status = reason;
  raw = {};
  jpeg = {};
  memory.resize_down(kRecordMemory);
}

void FrameQueue::push(Frame frame) {
  const std::scoped_lock lock(mutex_);
  assert(frames_.empty() || frames_.back()->time_ns < frame->time_ns);
  if (frame->stage == QueuedFrame::Stage::kToEncode) to_encode_.push_back(frame);
  frames_.push_back(std::move(frame));
}

FrameQueue::Frame FrameQueue::start_encoding() {
  const std::scoped_lock lock(mutex_);
  while (!to_encode_.empty()) {
    const Frame frame = std::move(to_encode_.front());
    to_encode_.pop_front();
    if (frame->stage != QueuedFrame::Stage::kToEncode) continue;  // given up meanwhile
    frame->stage = QueuedFrame::Stage::kEncoding;
    return frame;
  }
  return nullptr;
}

void FrameQueue::finish_encoding(const Frame& frame, std::optional<std::vector<std::byte>> jpeg) {
  RawImage done;  // freed outside of the lock
  const std::scoped_lock lock(mutex_);
  assert(frame->stage == QueuedFrame::Stage::kEncoding);
  if (!jpeg) {
    frame->become_missing(FrameStatus::kDroppedEncoder);
    ++encoder_failures_;
    return;
  }
  std::swap(done, frame->raw);
  frame->jpeg = std::move(*jpeg);
  frame->stage = QueuedFrame::Stage::kReady;
  frame->memory.resize_down(frame->jpeg.capacity() + kRecordMemory);
}

FrameQueue::Frame FrameQueue::front_ready() const {
  const std::scoped_lock lock(mutex_);
  if (frames_.empty() || frames_.front()->stage != QueuedFrame::Stage::kReady) return nullptr;
  return frames_.front();
}

void FrameQueue::pop_front() {
  Frame done;  // freed outside of the lock
  const std::scoped_lock lock(mutex_);
  std::swap(done, frames_.front());
  frames_.pop_front();
}

bool FrameQueue::give_up(bool oldest, FrameStatus reason) {
  const std::scoped_lock lock(mutex_);
  const auto waits = [](const Frame& frame) {
    return frame->holds_picture() && frame->stage != QueuedFrame::Stage::kEncoding;
  };
  if (oldest) {
    // Not the very front: the writer may be writing it.
    const auto found =
        std::find_if(frames_.begin() + (frames_.empty() ? 0 : 1), frames_.end(), waits);
    if (found == frames_.end()) return false;
    (*found)->become_missing(reason);
    return true;
  }
  const auto found = std::find_if(frames_.rbegin(), frames_.rend(), waits);
  if (found == frames_.rend() || *found == frames_.front()) return false;
  (*found)->become_missing(reason);
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

}  // namespace raystage
