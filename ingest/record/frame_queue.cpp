// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/frame_queue.h"

#include <algorithm>
#include <cassert>
#include <iterator>
#include <new>
#include <utility>

namespace raystage::ingest {

void QueuedFrame::mark_missing(store::FrameStatus reason) {
  stage = Stage::kReady;
  status = reason;
  raw = {};
  jpeg = {};
  memory.shrink_to(kMissingRecordBytes);
}

void FrameQueue::set_writers(std::size_t count) {
  const std::scoped_lock lock(mutex_);
  assert(frames_.empty() && count > 0);
  writers_.resize(count);
}

void FrameQueue::push(Frame frame) {
  const std::scoped_lock lock(mutex_);
  assert(frames_.empty() || frames_.back()->time_ns < frame->time_ns);
  frames_.push_back(frame);
  if (frame->stage != QueuedFrame::Stage::kToEncode) return;
  try {
    to_encode_.push_back(std::move(frame));
  } catch (const std::bad_alloc&) {
    frames_.pop_back();
    throw;
  }
  ++waiting_;
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

void FrameQueue::finish_encoding(const Frame& frame, std::optional<std::vector<std::byte>> jpeg,
                                 store::FrameStatus failure) {
  store::RawImage done;  // freed outside of the lock
  const std::scoped_lock lock(mutex_);
  assert(frame->stage == QueuedFrame::Stage::kEncoding);
  if (!jpeg) {
    frame->mark_missing(failure);
    ++encoder_failures_;
    return;
  }
  std::swap(done, frame->raw);
  frame->jpeg = std::move(*jpeg);
  frame->stage = QueuedFrame::Stage::kReady;
  frame->memory.shrink_to(frame->jpeg.capacity() + kMissingRecordBytes);
}

std::vector<FrameQueue::Frame> FrameQueue::start_writing(std::size_t max_frames,
                                                         std::size_t writer) {
  std::vector<Frame> ready;
  const std::scoped_lock lock(mutex_);
  Writer& own = writers_[writer];
  if (own.stopped) return ready;
  for (std::size_t i = own.done; i < frames_.size(); ++i) {
    if (ready.size() == max_frames || frames_[i]->stage != QueuedFrame::Stage::kReady) break;
    ready.push_back(frames_[i]);
  }
  own.writing = ready.size();
  return ready;
}

void FrameQueue::finish_writing(std::size_t written, std::size_t writer) {
  const std::scoped_lock lock(mutex_);
  Writer& own = writers_[writer];
  if (own.stopped) {
    own = {.stopped = true};
    return;
  }
  assert(written <= own.writing);
  own.done += written;
  own.writing = 0;
  // The images are freed outside of the lock, with the writer's own references.
  remove_written();
}

void FrameQueue::stop_writer(std::size_t writer) {
  const std::scoped_lock lock(mutex_);
  // Its thread may still write frames: they are counted until its finish_writing().
  Writer& own = writers_[writer];
  own.stopped = true;
  if (own.writing == 0) own.done = 0;
  remove_written();
}

/// Removes the frames that all writers have written. Allocates nothing.
void FrameQueue::remove_written() {
  std::size_t all_done = frames_.size();
  for (const Writer& writer : writers_) {
    if (!writer.stopped) all_done = std::min(all_done, writer.done);
  }
  frames_.erase(frames_.begin(), frames_.begin() + static_cast<std::ptrdiff_t>(all_done));
  for (Writer& writer : writers_) {
    // A stopped writer keeps frames that are removed here by its own references.
    const std::size_t done = std::min(writer.done, all_done);
    writer.done -= done;
    writer.writing -= std::min(writer.writing, all_done - done);
  }
}

std::size_t FrameQueue::bytes_only_for(std::size_t writer) const {
  const std::scoped_lock lock(mutex_);
  if (writers_[writer].stopped) return 0;
  std::size_t others_done = frames_.size();
  for (std::size_t i = 0; i < writers_.size(); ++i) {
    if (i != writer && !writers_[i].stopped) others_done = std::min(others_done, writers_[i].done);
  }
  std::size_t bytes = 0;
  for (std::size_t i = writers_[writer].done; i < others_done; ++i) {
    bytes += frames_[i]->memory.bytes();
  }
  return bytes;
}

bool FrameQueue::drop_one(bool oldest, store::FrameStatus reason) {
  const std::scoped_lock lock(mutex_);
  const auto waits = [](const Frame& frame) {
    return frame->has_image() && frame->stage != QueuedFrame::Stage::kEncoding;
  };
  // A frame that is in one copy must get into the other. The next one to be written is never
  // dropped, nor one that a stopped writer still reads.
  std::size_t kept = 1;
  for (const Writer& writer : writers_) {
    const std::size_t least = writer.stopped ? 0 : 1;
    kept = std::max(kept, writer.done + std::max(writer.writing, least));
  }
  kept = std::min(frames_.size(), kept);
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

std::size_t FrameQueue::size(std::size_t writer) const {
  const std::scoped_lock lock(mutex_);
  return writers_[writer].stopped ? 0 : frames_.size() - writers_[writer].done;
}

std::size_t FrameQueue::size_for_all() const {
  const std::scoped_lock lock(mutex_);
  return frames_.size();
}

}  // namespace raystage::ingest
