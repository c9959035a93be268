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

namespace raystage::ingest {

/// One frame of a camera on its way from the source to the archive, or a record of a missing frame.
struct QueuedFrame {
  enum class Stage {
    kToEncode,  ///< `raw` waits for an encoder
    kEncoding,  ///< an encoder works on it
    kReady      ///< `jpeg`, or a record of a missing frame, waits to be written
  };
  Stage stage = Stage::kReady;
  store::FrameStatus status = store::FrameStatus::kStored;
  Nanoseconds time_ns = 0;  ///< since the take's epoch
  store::FrameOrigin origin;
  store::RawImage raw;
  std::vector<std::byte> jpeg;
  MemoryBudget::Reservation memory;

  bool has_image() const { return status == store::FrameStatus::kStored; }
  /// Frees the image and keeps a record of a missing frame.
  void mark_missing(store::FrameStatus reason);
};

/// Memory that one record of a missing frame needs, in bytes.
inline constexpr std::size_t kMissingRecordBytes = sizeof(QueuedFrame) + 64;

/// Keeps the frames of one camera in memory, ordered by time. Thread-safe: the source's thread
/// appends frames, encoders process frames in between, the writer removes them at the front.
class FrameQueue {
 public:
  /// Encoders share ownership of their frames; no other thread may access a frame in kEncoding.
  using Frame = std::shared_ptr<QueuedFrame>;

  void push(Frame frame);

  /// Returns true, and counts a request, if fewer calls of start_encoding() are requested than
  /// frames are in kToEncode. Dropped frames need none.
  bool needs_encoder();
  /// Returns the oldest frame in kToEncode and sets it to kEncoding; null if there is none.
  Frame start_encoding();
  /// Stores the encoder's result. Without `jpeg` the frame is recorded as kDroppedEncoder.
  void finish_encoding(const Frame& frame, std::optional<std::vector<std::byte>> jpeg);

  /// Returns the frames at the front that are ready, at most `max_frames`. They stay in the queue
  /// unchanged until finish_writing().
  std::vector<Frame> start_writing(std::size_t max_frames);
  /// Removes the first `written` of those frames; the others wait to be written again.
  void finish_writing(std::size_t written);

  /// Turns the oldest or newest waiting frame into a record of a dropped frame. Returns false if
  /// there is none: the queue is empty, or encoders and the writer use all of its frames.
  bool drop_one(bool oldest, store::FrameStatus reason);

  std::uint64_t encoder_failures() const { return encoder_failures_; }
  bool empty() const;
  std::size_t size() const;

 private:
  mutable std::mutex mutex_;
  std::deque<Frame> frames_;
  std::size_t writing_ = 0;  // number of frames at the front that the writer is writing
  std::atomic<std::uint64_t> encoder_failures_ = 0;
  std::deque<Frame> to_encode_;  // the frames that no encoder has taken yet, some of them dropped
  std::size_t waiting_ = 0;      // number of frames in to_encode_ that are not dropped
  std::size_t encoders_requested_ = 0;
};

}  // namespace raystage::ingest
