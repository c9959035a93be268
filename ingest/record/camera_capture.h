// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "ingest/record/encoder_pool.h"
#include "ingest/record/frame_queue.h"
#include "ingest/record/frame_timestamper.h"
#include "ingest/record/host_clock.h"
#include "ingest/record/memory_budget.h"
#include "ingest/record/reconnect_backoff.h"
#include "ingest/sources/frame_source.h"
#include "schemas/record_config.h"

namespace raystage::ingest {

/// An event of one camera during a recording.
struct RecordingEvent {
  Nanoseconds time_utc = 0;
  std::string what;
};

/// Counts the frames of one camera by outcome. The threads of the camera write it; any thread may
/// read it.
struct CameraCounters {
  enum class State { kRunning, kLost, kEnded };
  std::atomic<State> state = State::kRunning;
  std::atomic<bool> is_absent = false;                  ///< since the start; false once it came
  std::atomic<std::uint64_t> arrived = 0;               ///< frames that the source delivered
  std::atomic<std::uint64_t> dropped = 0;               ///< of these, not to be stored (any reason)
  std::atomic<std::uint64_t> skipped_by_source = 0;     ///< gaps in the source's own counter
  std::atomic<std::uint64_t> corrected_timestamps = 0;  ///< FrameTimestamper::Stamp::corrected
  std::atomic<std::uint64_t> unrecorded = 0;  ///< lost without a record: the audit requires 0

  void add_event(std::string what);
  /// The description of a source that was opened during the recording; nullopt: none was.
  void set_description(SourceDescription description);
  std::optional<SourceDescription> description() const;
  std::vector<RecordingEvent> events() const;

 private:
  mutable std::mutex mutex_;
  std::vector<RecordingEvent> events_;
  std::optional<SourceDescription> description_;
};

/// Moves the frames of one camera from its source into memory. Waits only for the source, or for
/// memory if `wait_for_memory` permits it.
class CameraCapture {
 public:
  using LostSourcePolicy = schemas::RecordConfig::LostSourcePolicy;
  struct Options {
    Nanoseconds epoch_utc = 0;
    Nanoseconds last_time = -1;  ///< last time in an archive that is resumed, since the epoch
    Nanoseconds start_utc = 0;   ///< frames that arrive earlier are ignored
    int width = 0, height = 0;   ///< of the archive, pixels; frames of other sizes are not stored
    bool drop_oldest = false;    ///< when memory is full, drop the oldest frame, else the new one
    /// How long a source that can wait without loss waits for memory. After a timeout (a disk that
    /// stays full) its frames are dropped until memory is free again. 0: it does not wait.
    std::chrono::milliseconds wait_for_memory{0};
    LostSourcePolicy when_lost = LostSourcePolicy::kContinue;
    std::chrono::milliseconds lost_after{5000};
    std::string absence = {};  ///< why the source could not be opened; empty: it is open
    ReconnectBackoff::Limits reconnect;
  };
  /// The objects that a capture uses; all of them outlive it.
  struct Pipeline {
    FrameQueue& queue;
    MemoryBudget& memory;   ///< of frames
    MemoryBudget& records;  ///< of records of missing frames
    EncoderPool& encoders;
    CameraCounters& counters;
    HostClock& host_clock;
    std::function<void()> stop_recording;  ///< for LostSourcePolicy::kStop
    /// Called if the memory is full; returns whether it freed some. Null: nothing can be done.
    std::function<bool()> free_memory = {};
  };
  using Open = std::function<std::unique_ptr<FrameSource>()>;

  CameraCapture(const Options& options, std::unique_ptr<FrameSource> source, Open reopen,
                Pipeline pipeline);

  /// Runs until it is stopped, or its source has ended or is lost for good.
  void run(const std::stop_token& stop);
  /// Processes one frame of the source; called by run() and by tests.
  void take(SourceFrame frame);

 private:
  enum class LossOutcome { kContinueWaiting, kReconnected, kFinish };
  LossOutcome lost(const std::stop_token& stop, const std::string& why, bool source_is_gone);
  bool wait_for_absent(const std::stop_token& stop);
  bool reconnect(const std::stop_token& stop, std::string_view connected);
  bool has_size_of_archive(const SourceDescription& source);
  void pause(const std::stop_token& stop, std::chrono::milliseconds time);
  void replace_source(std::unique_ptr<FrameSource> source);
  FrameSource::Outcome next_frame(SourceFrame& frame);
  bool push(SourceFrame& frame, const FrameTimestamper::Stamp& stamp,
            MemoryBudget::Reservation reservation);
  store::FrameStatus check(const SourceFrame& frame);
  void report_steps(const FrameTimestamper::Stamp& stamp);
  MemoryBudget::Reservation reserve_memory(std::size_t bytes);
  MemoryBudget::Reservation wait_for_memory(std::size_t bytes);
  void push_missing_record(store::FrameStatus status, Nanoseconds time, store::FrameOrigin origin);

  const Options options_;
  std::mutex source_mutex_;              // held while the source is replaced or interrupted
  std::unique_ptr<FrameSource> source_;  // null during a reconnection
  const Open reopen_;
  Pipeline pipeline_;
  FrameTimestamper clock_;
  ReconnectBackoff reconnect_backoff_;
  std::mutex pause_mutex_;
  std::condition_variable_any pause_ended_;  // notified only by a stop
  std::stop_token stop_;                     // of run()
  bool memory_was_freed_ = true;             // false: the last wait for memory timed out
  bool size_warning_given_ = false;
  bool host_step_reported_ = false, clock_step_reported_ = false, counter_jump_reported_ = false;
};

}  // namespace raystage::ingest
