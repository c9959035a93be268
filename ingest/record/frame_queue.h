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
  /// Set by the first writer that drops the frame: the copies of a take count it once.
  std::atomic<bool> is_counted_as_dropped = false;

  bool has_image() const { return status == store::FrameStatus::kStored; }
  /// Frees the image and keeps a record of a missing frame. No writer may be using it.
  void mark_missing(store::FrameStatus reason);
};

/// Memory that one record of a missing frame needs, in bytes.
inline constexpr std::size_t kMissingRecordBytes = sizeof(QueuedFrame) + 64;

/// Keeps the frames of one camera in memory, ordered by time. Thread-safe: the source's thread
/// appends frames, encoders process frames in between, the writers remove them at the front. There
/// is a writer for each copy of the take; a frame stays until all writers are done with it.
class FrameQueue {
 public:
  /// Encoders share ownership of their frames; no other thread may access a frame in kEncoding.
  using Frame = std::shared_ptr<QueuedFrame>;

  /// Sets the number of writers, at least 1 (the default). Call it before the first push().
  void set_writers(std::size_t count);
  /// Throws bad_alloc; the queue is unchanged then.
  void push(Frame frame);

  /// Returns true, and counts a request, if fewer calls of start_encoding() are requested than
  /// frames are in kToEncode. Dropped frames need none.
  bool needs_encoder();
  /// Returns the oldest frame in kToEncode and sets it to kEncoding; null if there is none.
  Frame start_encoding();
  /// Stores the encoder's result. Without `jpeg` the frame is recorded as dropped by `failure`.
  void finish_encoding(const Frame& frame, std::optional<std::vector<std::byte>> jpeg,
                       store::FrameStatus failure = store::FrameStatus::kDroppedEncoder);

  /// Returns the first frames that this writer has not written and that are ready, at most
  /// `max_frames`. They stay in the queue unchanged until finish_writing().
  std::vector<Frame> start_writing(std::size_t max_frames, std::size_t writer = 0);
  /// Marks the first `written` of those frames as done; the others wait to be written again.
  void finish_writing(std::size_t written, std::size_t writer = 0);
  /// Keeps no more frames for a writer, which receives none from now on. Frames that it is writing
  /// are not dropped before its finish_writing().
  void stop_writer(std::size_t writer);
  /// Returns the memory in bytes of the frames that every other writer has written.
  std::size_t bytes_only_for(std::size_t writer) const;

  /// Turns the oldest or newest waiting frame into a record of a dropped frame. Returns false if
  /// there is none: the queue is empty, or encoders and the writer use all of its frames.
  bool drop_one(bool oldest, store::FrameStatus reason);

  std::uint64_t encoder_failures() const { return encoder_failures_; }
  /// Return whether, and how many, frames wait for a writer that was not stopped.
  bool empty(std::size_t writer = 0) const { return size(writer) == 0; }
  std::size_t size(std::size_t writer = 0) const;
  /// Returns the number of frames in memory.
  std::size_t size_for_all() const;

 private:
  struct Writer {
    std::size_t done = 0;     // frames at the front that it has written
    std::size_t writing = 0;  // frames after them that it is writing
    bool stopped = false;
  };
  void remove_written();

  mutable std::mutex mutex_;
  std::deque<Frame> frames_;
  std::vector<Writer> writers_ = std::vector<Writer>(1);
  std::atomic<std::uint64_t> encoder_failures_ = 0;
  std::deque<Frame> to_encode_;  // the frames that no encoder has taken yet, some of them dropped
  std::size_t waiting_ = 0;      // number of frames in to_encode_ that are not dropped
  std::size_t encoders_requested_ = 0;
};

}  // namespace raystage::ingest
