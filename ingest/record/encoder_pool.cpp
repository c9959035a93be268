// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/encoder_pool.h"

#include <new>
#include <utility>

namespace raystage::ingest {

EncoderPool::EncoderPool(const store::JpegEncodeOptions& options, int threads)
    // TBB counts the calling thread too, but sources never encode themselves: allow one more
    // worker, and reserve no slot for callers.
    : options_(options),
      parallelism_(tbb::global_control::max_allowed_parallelism,
                   static_cast<std::size_t>(threads) + 1),
      arena_(threads, 0) {}

EncoderPool::~EncoderPool() { wait(); }

void EncoderPool::encode_next(FrameQueue& queue) {
  // Otherwise tasks for dropped frames would accumulate when encoding is too slow.
  if (!queue.needs_encoder()) return;
  tasks_submitted_.fetch_add(1, std::memory_order_release);
  try {
    arena_.enqueue(group_.defer([this, &queue] {
      tasks_submitted_.load(std::memory_order_acquire);
      encode_from(queue);
      tasks_completed_.fetch_add(1, std::memory_order_release);
    }));
  } catch (const std::bad_alloc&) {
    encode_from(queue);  // here: a frame that nobody encodes would hold up all after it
  }
}

void EncoderPool::wait() {
  group_.wait();
  tasks_completed_.load(std::memory_order_acquire);
}

std::unique_ptr<store::RawJpegEncoder> EncoderPool::acquire_encoder() {
  {
    const std::scoped_lock lock(mutex_);
    if (!idle_.empty()) {
      auto encoder = std::move(idle_.back());
      idle_.pop_back();
      return encoder;
    }
  }
  return std::make_unique<store::RawJpegEncoder>(options_);
}

void EncoderPool::encode_from(FrameQueue& queue) {
  const FrameQueue::Frame frame = queue.start_encoding();
  if (!frame) return;  // dropped meanwhile
  std::optional<std::vector<std::byte>> result;
  auto failure = store::FrameStatus::kDroppedEncoder;
  // No exception may leave a TBB task: after any failure the frame is recorded as missing.
  try {
    auto encoder = acquire_encoder();
    encoder->encode(frame->raw, result.emplace());
    const std::scoped_lock lock(mutex_);
    idle_.push_back(std::move(encoder));
  } catch (const std::bad_alloc&) {
    result.reset();
    failure = store::FrameStatus::kDroppedMemoryCeiling;
  } catch (const std::exception&) {
    result.reset();
  }
  queue.finish_encoding(frame, std::move(result), failure);
}

}  // namespace raystage::ingest
