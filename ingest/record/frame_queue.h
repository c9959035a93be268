// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "base/time.h"
#include "ingest/record/memory_budget.h"
#include "store/archive.h"
#include "store/jpeg/raw_image.h"

namespace raystage {

/// One frame of a camera on its way from the source to the archive, or the record that it is
/// missing.
struct QueuedFrame {
  enum class Stage {
    kToEncode,  ///< `raw` waits for an encoder
    kEncoding,  ///< an encoder works on it
    kReady      ///< `jpeg` waits to be written, or a record of what is missing
  };
  Stage stage = Stage::kReady;
  FrameStatus status = FrameStatus::kStored;
  Nanoseconds time_ns = 0;  ///< since the take's epoch
  FrameOrigin origin;
  RawImage raw;
  std::vector<std::byte> jpeg;
  MemoryBudget::Reservation memory;

  bool has_image() const { return status == FrameStatus::kStored; }
  /// Frees the picture; what remains is the record that it is missing.
  void mark_missing(FrameStatus reason);
};

/// What one record of a missing frame costs in memory, bytes.
inline constexpr std::size_t kMissingRecordBytes = sizeof(QueuedFrame) + 64;

/// One camera's frames in memory, in the order of their times. Thread-safe: the source's thread
/// pushes, encoders work on frames in the middle, the writer takes them from the front.
class FrameQueue {
 public:
  /// The encoders hold the frames they work on; no other thread may touch a frame in kEncoding.
  using Frame = std::shared_ptr<QueuedFrame>;

  void push(Frame frame);

  /// Whether one more start_encoding() must be arranged for: true until as many are to come as
  /// there are frames in kToEncode. Those that are given up need none.
  bool needs_encoder();
  /// The oldest frame in kToEncode, set to kEncoding; null where there is none.
  Frame start_encoding();
  /// The encoder's result. Without `jpeg` the frame is missing: kDroppedEncoder.
  void finish_encoding(const Frame& frame, std::optional<std::vector<std::byte>> jpeg);

  /// The frames at the front that are ready, at most so many. They stay in the queue, and as they
  /// are, until finish_writing().
  std::vector<Frame> start_writing(std::size_t most);
  /// Takes the first `written` of those away; the others wait to be written again.
  void finish_writing(std::size_t written);

  /// Turns a waiting frame, the oldest or the newest, into a record that it was dropped. False
  /// where no frame can be given up (none there, or all in the hands of encoders or the writer).
  bool drop_one(bool oldest, FrameStatus reason);

  std::uint64_t encoder_failures() const { return encoder_failures_; }
  bool empty() const;
  std::size_t size() const;

 private:
  mutable std::mutex mutex_;
  std::deque<Frame> frames_;
  std::size_t writing_ = 0;  // so many at the front are in the writer's hands
  std::atomic<std::uint64_t> encoder_failures_ = 0;
  std::deque<Frame> to_encode_;  // those of frames_ that no encoder has taken yet
  std::size_t waiting_ = 0;      // of these so many have not been given up
  std::size_t encoders_requested_ = 0;
};

}  // namespace raystage
