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
class Encoders {
 public:
  /// `threads`: as many frames at once.
  Encoders(const JpegEncodeSettings& settings, int threads);
  ~Encoders();
  Encoders(const Encoders&) = delete;
  Encoders& operator=(const Encoders&) = delete;

  /// `queue` got a frame in kToEncode, and outlives this.
  void encode_one_of(FrameQueue& queue);
  /// Returns when everything that was asked for is encoded.
  void wait();

 private:
  void work_on(FrameQueue& queue);
  std::unique_ptr<RawJpegEncoder> borrow();

  const JpegEncodeSettings settings_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<RawJpegEncoder>> idle_;
  tbb::global_control parallelism_;
  tbb::task_arena arena_;
  tbb::task_group group_;
  // What is handed to TBB's threads and back. TBB orders it too, but only atomics of our own let
  // the thread sanitizer see that: Debian's TBB is not built for it.
  std::atomic<std::uint64_t> handed_over_ = 0, handed_back_ = 0;
};

}  // namespace raystage
