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

/// Encodes the raw frames of all cameras as JPEG on TBB threads. encode_next() does not wait, so no
/// source is delayed, unless TBB refuses the work: then it encodes frames itself.
class EncoderPool {
 public:
  /// Starts the threads, so that none has to be started when memory is short: TBB ends the process
  /// if that fails. `threads`: the number of frames encoded in parallel.
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
  void start_threads(int threads);
  void run_tasks();
  bool encode_from(FrameQueue& queue);
  void keep(std::unique_ptr<store::RawJpegEncoder> encoder);
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
  std::atomic<int> threads_started_ = 0;
  std::atomic<bool> threads_failed_ = false;  // TBB could not start one: tasks may have no thread
};

}  // namespace raystage::ingest
