// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/global_control.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "ingest/record/frame_queue.h"
#include "store/jpeg/raw_encoder.h"

namespace raystage::ingest {

/// Encodes the raw frames of all cameras as JPEG on TBB threads. encode_next() never waits, so no
/// source is delayed.
class EncoderPool {
 public:
  /// Prepares the pool. `threads`: the number of frames encoded in parallel.
  EncoderPool(const store::JpegEncodeOptions& options, int threads);
  ~EncoderPool();
  EncoderPool(const EncoderPool&) = delete;
  EncoderPool& operator=(const EncoderPool&) = delete;

  /// Schedules the encoding of a frame that was pushed to `queue` in stage kToEncode. `queue` must
  /// outlive this pool.
  void encode_next(FrameQueue& queue);
  /// Waits until all scheduled frames are encoded.
  void wait();

 private:
  void encode_from(FrameQueue& queue);
  std::unique_ptr<store::RawJpegEncoder> acquire_encoder();

  const store::JpegEncodeOptions options_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<store::RawJpegEncoder>> idle_;
  tbb::global_control parallelism_;
  tbb::task_arena arena_;
  tbb::task_group group_;
  // These atomics show the thread sanitizer the order of memory accesses between threads, which TBB
  // guarantees as well: Debian's TBB is not instrumented.
  std::atomic<std::uint64_t> tasks_submitted_ = 0, tasks_completed_ = 0;
};

}  // namespace raystage::ingest
