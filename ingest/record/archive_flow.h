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

#include "ingest/record/camera_intake.h"
#include "ingest/record/frame_queue.h"
#include "ingest/record/memory_budget.h"
#include "store/archive.h"

namespace raystage {

/// From memory to the archives, in a thread of its own. A disk that is slow or full holds up nobody
/// but this: frames stay in memory until they can be written, and what cannot be kept there is
/// dropped by the intakes. An archive that refuses alone holds up no other camera's.
class ArchiveFlow {
 public:
  struct Camera {
    FrameQueue& queue;
    ArchiveWriter& archive;
    CameraCounters& counters;
  };
  struct Settings {
    bool hold = false;  ///< write nothing before drain()
    /// Frees room for the last records when the disk stays full to the end.
    std::function<void()> release_reserve = [] {};
    /// How long drain() tries to write a camera's frames that its archive refuses, seconds.
    double patience = 3;
    /// How often what is written is made safe against power loss, seconds; 0: never.
    double flush_every = 1;
    /// What the frames are counted in: where it gets tight, they are written at once instead of
    /// several of a camera together.
    MemoryBudget* memory = nullptr;
  };

  ArchiveFlow(std::vector<Camera> cameras, Settings settings);
  ~ArchiveFlow();
  ArchiveFlow(const ArchiveFlow&) = delete;
  ArchiveFlow& operator=(const ArchiveFlow&) = delete;

  /// Writes all that is left; intakes and encoders have finished. `progress` gets the part done.
  void drain(const std::function<void(double)>& progress);

  /// Records on disk, per camera and FrameStatus.
  std::uint64_t written(std::size_t camera, FrameStatus status) const;
  std::uint64_t bytes_written() const { return bytes_written_.load(std::memory_order_relaxed); }
  /// Why the disk refuses at this moment, for the first camera it does so; empty where it does not.
  std::string trouble() const;
  /// The first time that what was written could not be made safe; empty: never. A disk says so once
  /// and may have lost it all the same when it works again.
  std::string flush_failure() const;

 private:
  struct Tally {
    std::array<std::atomic<std::uint64_t>, kFrameStatusCount> count{};
  };
  struct CameraTurns {
    std::chrono::steady_clock::time_point last_success, retry_at;
  };
  void write_on(const std::stop_token& stop);
  void flush_on(const std::stop_token& stop);
  enum class Wrote { kNothing, kAll, kSome };
  Wrote write_some();
  struct Turn {
    std::size_t written = 0;  // frames
    bool refused = false;
  };
  Turn write_turn(std::size_t camera);
  std::size_t write(std::size_t camera, std::span<const FrameQueue::Frame> frames);
  bool append(std::size_t camera, std::span<const FrameQueue::Frame> frames);
  void rest(const std::stop_token& stop);
  void set_trouble(std::size_t camera, std::string text);
  std::size_t waiting() const;
  bool patience_is_over() const;
  void give_up_rest();

  const std::vector<Camera> cameras_;
  const Settings settings_;
  std::vector<Tally> tallies_;
  std::vector<CameraTurns> turns_;  // the writer's, then drain()'s
  std::atomic<std::uint64_t> bytes_written_ = 0;
  mutable std::mutex trouble_mutex_;
  std::vector<std::string> troubles_;  // by camera; empty: none
  std::string flush_failure_;
  std::jthread writer_, flusher_;  // last: they use all of the above
};

/// What went wrong in an attempt; empty: nothing. Of any exception, as where memory has run out:
/// one that leaves a thread would end the process, and all frames in memory with it.
std::string trouble_in(const std::function<void()>& attempt);

}  // namespace raystage
