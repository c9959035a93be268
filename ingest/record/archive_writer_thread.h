// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "ingest/record/camera_capture.h"
#include "ingest/record/frame_queue.h"
#include "ingest/record/memory_budget.h"
#include "store/archive.h"

namespace raystage::ingest {

/// Writes frames from memory to the archives, in a thread of its own. A slow or full disk delays
/// only this thread. Frames stay in memory until they can be written; without free memory the
/// capture threads drop frames. An archive that refuses writes does not delay the archives of other
/// cameras. A frame that no archive can have is recorded as dropped, and not tried again.
class ArchiveWriterThread {
 public:
  struct Camera {
    FrameQueue& queue;
    store::ArchiveWriter& archive;
    CameraCounters& counters;
  };
  struct Options {
    bool hold = false;       ///< write nothing before drain()
    std::size_t writer = 0;  ///< which writer of the queues this is
    /// Frees disk space for the last records if the disk is still full at the end.
    std::function<void()> release_reserved_space = [] {};
    /// How long drain() retries a camera whose archive refuses frames, in seconds.
    double drain_timeout_s = 3;
    /// Interval of flushing written data to the disk (fdatasync), in seconds; 0: never.
    double flush_interval_s = 1;
    /// The budget of the frames. Under pressure they are written sooner, in smaller batches.
    MemoryBudget* memory = nullptr;
  };

  ArchiveWriterThread(std::vector<Camera> cameras, Options options);
  ~ArchiveWriterThread();
  ArchiveWriterThread(const ArchiveWriterThread&) = delete;
  ArchiveWriterThread& operator=(const ArchiveWriterThread&) = delete;

  /// Writes all remaining frames; capture and encoders must have finished. `progress` receives the
  /// fraction done, in [0, 1].
  void drain(const std::function<void(double)>& progress);
  /// The same in two steps. Returns false if frames remain that the disk refuses.
  bool write_remaining(const std::function<void(double)>& progress);
  /// Turns the remaining frames into records of dropped frames. All other writers of the queues
  /// must be stopped; their threads may still run.
  void drop_remaining();
  /// Writes no more frames, and lets the queues keep none for this writer. Thread-safe.
  void stop();

  /// Returns the number of records of a status that are written to a camera's archive.
  std::uint64_t written(std::size_t camera, store::FrameStatus status) const;
  std::uint64_t bytes_written() const { return bytes_written_.load(std::memory_order_relaxed); }
  /// Returns the current write error of the first camera that has one; empty without an error.
  std::string write_error() const;
  /// Returns the first error of flushing written data to the disk; empty if there was none. A disk
  /// reports such an error once and may have lost the data even if it works again afterwards.
  std::string flush_error() const;

 private:
  struct WrittenCounts {
    std::array<std::atomic<std::uint64_t>, store::kFrameStatusCount> count{};
  };
  struct RetryState {
    std::chrono::steady_clock::time_point last_write, retry_at;
    bool rejection_reported = false;
  };
  void write_loop(const std::stop_token& stop);
  void flush_loop(const std::stop_token& stop);
  enum class WriteResult { kNothing, kAll, kSome };
  WriteResult write_pending();
  struct BatchResult {
    std::size_t written = 0;  // frames
    bool refused = false;
  };
  BatchResult write_batch(std::size_t camera);
  std::size_t write(std::size_t camera, std::span<const FrameQueue::Frame> frames);
  enum class AppendResult {
    kWritten,
    kFailed,   // the disk did not accept the frames, or there is no memory
    kRejected  // one of them has no valid time or size
  };
  AppendResult append(std::size_t camera, std::span<const FrameQueue::Frame> frames);
  bool record_rejected(std::size_t camera, QueuedFrame& frame);
  void wait_before_next_pass(const std::stop_token& stop);
  void set_write_error(std::size_t camera, std::string text);
  std::size_t waiting() const;
  bool drain_timed_out() const;

  const std::vector<Camera> cameras_;
  const Options options_;
  std::vector<WrittenCounts> written_counts_;
  std::vector<RetryState> retry_states_;  // used by the writer thread, later by drain()
  std::atomic<std::uint64_t> bytes_written_ = 0;
  std::atomic<bool> stopped_ = false;
  mutable std::mutex write_error_mutex_;
  std::vector<std::string> write_errors_;  // by camera; empty: none
  std::string flush_failure_;
  std::jthread writer_, flusher_;  // last: they use all of the above
};

/// Runs `attempt` and returns the message of its exception, or an empty text. Catches bad_alloc
/// too: an exception that leaves a thread would end the process and lose all frames in memory.
std::string exception_message(const std::function<void()>& attempt);

}  // namespace raystage::ingest
