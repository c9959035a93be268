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

namespace raystage {

/// Encodes the raw frames of all cameras on TBB's threads. A source never waits: it says that its
/// queue holds a frame more, and goes on.
class EncoderPool {
 public:
  /// `threads`: as many frames at once.
  EncoderPool(const JpegEncodeSettings& settings, int threads);
  ~EncoderPool();
  EncoderPool(const EncoderPool&) = delete;
  EncoderPool& operator=(const EncoderPool&) = delete;

  /// `queue` got a frame in kToEncode, and outlives this.
  void encode_next(FrameQueue& queue);
  /// Returns when everything that was asked for is encoded.
  void wait();

 private:
  void encode_from(FrameQueue& queue);
  std::unique_ptr<RawJpegEncoder> acquire_encoder();

  const JpegEncodeSettings settings_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<RawJpegEncoder>> idle_;
  tbb::global_control parallelism_;
  tbb::task_arena arena_;
  tbb::task_group group_;
  // What is handed to TBB's threads and back. TBB orders it too, but only atomics of our own let
  // the thread sanitizer see that: Debian's TBB is not built for it.
  std::atomic<std::uint64_t> tasks_submitted_ = 0, tasks_completed_ = 0;
};

}  // namespace raystage
