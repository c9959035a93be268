// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/encoder_pool.h"

#include <chrono>
#include <exception>
#include <new>
#include <optional>
#include <thread>
#include <utility>

namespace raystage::ingest {

EncoderPool::EncoderPool(const store::JpegEncodeOptions& options, int threads)
    // TBB counts the calling thread too, but sources never encode themselves: allow one more
    // worker, and reserve no slot for callers.
    : options_(options),
      parallelism_(tbb::global_control::max_allowed_parallelism,
                   static_cast<std::size_t>(threads) + 1),
      arena_(threads, 0) {
  start_threads(threads);
}

EncoderPool::~EncoderPool() { wait(); }

/// Gives each thread a task that ends when all have one.
void EncoderPool::start_threads(int threads) {
  using namespace std::chrono_literals;
  using Clock = std::chrono::steady_clock;
  const auto deadline = Clock::now() + 1s;  // other work may keep TBB's threads busy
  const auto wait_for_all = [this, threads, deadline] {
    while (threads_started_ < threads && Clock::now() < deadline) {
      std::this_thread::sleep_for(100us);
    }
  };
  try {
    for (int i = 0; i < threads; ++i) {
      tasks_submitted_.fetch_add(1, std::memory_order_release);
      arena_.enqueue(group_.defer([this, wait_for_all] {
        tasks_submitted_.load(std::memory_order_acquire);
        ++threads_started_;
        wait_for_all();
        tasks_completed_.fetch_add(1, std::memory_order_release);
      }));
    }
  } catch (const std::exception&) {
    threads_failed_ = true;
  }
  wait_for_all();
  if (threads_started_ < threads) {
    run_tasks();
  } else {
    wait();
  }
}

/// Waits for all tasks, and runs those that have no thread.
void EncoderPool::run_tasks() {
  arena_.execute([this] { group_.wait(); });
  tasks_completed_.load(std::memory_order_acquire);
}

void EncoderPool::encode_next(FrameQueue& queue) {
  if (!threads_failed_) {
    // Otherwise tasks for dropped frames would accumulate when encoding is too slow.
    if (!queue.needs_encoder()) return;
    tasks_submitted_.fetch_add(1, std::memory_order_release);
    try {
      arena_.enqueue(group_.defer([this, &queue] {
        tasks_submitted_.load(std::memory_order_acquire);
        encode_from(queue);
        tasks_completed_.fetch_add(1, std::memory_order_release);
      }));
      return;
    } catch (const std::bad_alloc&) {
      encode_from(queue);  // here: a frame that is not encoded would hold up all after it
      return;
    } catch (const std::exception&) {
      threads_failed_ = true;
    }
  }
  // With those of earlier tasks, which may have no thread.
  while (encode_from(queue)) {
  }
}

void EncoderPool::wait() {
  if (threads_failed_) return run_tasks();
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

void EncoderPool::keep(std::unique_ptr<store::RawJpegEncoder> encoder) {
  const std::scoped_lock lock(mutex_);
  try {
    idle_.push_back(std::move(encoder));
  } catch (const std::bad_alloc&) {  // another one is made when it is needed
  }
}

/// Encodes the oldest frame that waits. Returns false if there is none: it was dropped meanwhile.
bool EncoderPool::encode_from(FrameQueue& queue) {
  const FrameQueue::Frame frame = queue.start_encoding();
  if (!frame) return false;
  std::optional<std::vector<std::byte>> result;
  auto failure = store::FrameStatus::kDroppedEncoder;
  // No exception may leave a TBB task: after any failure the frame is recorded as missing.
  try {
    auto encoder = acquire_encoder();
    encoder->encode(frame->raw, result.emplace());
    keep(std::move(encoder));
  } catch (const std::bad_alloc&) {
    result.reset();
    failure = store::FrameStatus::kDroppedMemoryCeiling;
  } catch (const std::exception&) {
    result.reset();
  }
  queue.finish_encoding(frame, std::move(result), failure);
  return true;
}

}  // namespace raystage::ingest
