// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <stop_token>
#include <thread>
#include <vector>

#include "ingest/record/frame_queue.h"
#include "store/jpeg/encode.h"
#include "store/jpeg/raw_encoder.h"

namespace raystage {

/// Encodes the raw frames of all cameras, each thread with an encoder of its own. A source never
/// waits: it says that its queue holds a frame more, and goes on.
class Encoders {
 public:
  /// `threads`: as many frames at once. Throws Error (bad input) for a wrong quality.
  Encoders(const JpegEncodeSettings& settings, int threads);
  /// Drops what was asked for and is not begun.
  ~Encoders() = default;
  Encoders(const Encoders&) = delete;
  Encoders& operator=(const Encoders&) = delete;

  /// `queue` got a frame in kToEncode, and outlives this.
  void encode_one_of(FrameQueue& queue);
  /// Returns when everything that was asked for is encoded.
  void wait();

 private:
  void work(const std::stop_token& stop, RawJpegEncoder& encoder);
  FrameQueue* next(const std::stop_token& stop);

  std::mutex mutex_;
  std::condition_variable_any done_, asked_for_;
  std::deque<FrameQueue*> asked_;    // each once per frame
  std::size_t busy_ = 0, idle_ = 0;  // threads that encode, that wait to be called
  std::vector<RawJpegEncoder> encoders_;
  std::vector<std::jthread> threads_;  // last: they use all of the above
};

}  // namespace raystage
