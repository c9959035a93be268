// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "ingest/record/archive_writer_thread.h"
#include "ingest/record/camera_capture.h"
#include "ingest/record/frame_queue.h"
#include "ingest/record/memory_budget.h"
#include "ingest/record/recording_take.h"
#include "schemas/recording_document.h"

namespace raystage::ingest {

/// Writes the frames of a recording to each copy of its take: the take itself and, by choice, a
/// mirror. Each copy has a writer thread of its own and gets the same records in the same order. A
/// copy whose disk fails or is too slow is stopped: it ends with a whole frame, and the recording
/// goes on in the other. The last copy is never stopped.
class RecordingCopies {
 public:
  /// What all copies share; outlives this object.
  struct Frames {
    std::vector<FrameQueue>& queues;  ///< by camera
    std::vector<CameraCounters>& counters;
    MemoryBudget& memory;
  };
  struct Options {
    bool hold = false;
    double drain_timeout_s = 3, flush_interval_s = 1;  ///< see ArchiveWriterThread::Options
  };
  /// The state of a copy, for display.
  struct Status {
    std::filesystem::path folder;
    std::string stop_reason;  ///< empty: the copy is complete so far
    std::string write_error;  ///< of its disk; empty: none
    std::size_t waiting = 0;  ///< bytes of frames that wait only for this copy
  };

  /// Starts to write. `takes`: the take first, then its mirrors.
  RecordingCopies(std::vector<RecordingTake*> takes, const Frames& frames, const Options& options);

  /// Stops a copy whose disk lost data, or for which most of the memory waits although the other
  /// copy has these frames. Called every few milliseconds.
  void watch();
  /// The same for a full memory, of which a quarter is enough. Returns whether it stopped a copy.
  /// Thread-safe.
  bool free_memory();
  /// Writes all remaining frames to each copy. One whose disk refuses them is stopped if another
  /// has them all; otherwise the copy with most frames goes on, and what it lacks becomes records
  /// of dropped frames. A copy whose disk hangs for 30 s is stopped if another is done.
  void drain(const std::function<void(double)>& progress);
  /// Closes the archives of the copies, and adds errors of the reference copy to `problems`.
  void close(std::vector<std::string>& problems);
  /// Audits the reference copy, and stops other copies that have other records. Then writes the
  /// session to all copies; if the reference copy does not accept it, its audit says so. Last it
  /// closes the copies that were stopped, which waits as long as their disks hang.
  void finish(schemas::RecordingDocument::Session& session, std::vector<std::string> problems);

  /// Returns the number of records of a status that are in the reference copy: the take, or after
  /// that was stopped, its mirror.
  std::uint64_t written(std::size_t camera, store::FrameStatus status) const;
  std::uint64_t bytes_written() const;
  std::string write_error() const;  ///< of the reference copy
  /// Returns the folders that are still written.
  std::vector<std::filesystem::path> active_folders() const;
  std::vector<Status> status() const;

 private:
  /// Writes what remains at the end.
  struct Drain {
    std::atomic<bool> is_over = false, is_whole = false;
    std::jthread thread;  // last: it uses the others
  };
  struct Copy {
    RecordingTake* take = nullptr;
    std::unique_ptr<ArchiveWriterThread> writer;
    std::string stop_reason = {};       // written once, before is_stopped
    std::unique_ptr<Drain> drain = {};  // after the writer, which it uses
    std::unique_ptr<std::atomic<bool>> is_stopped = std::make_unique<std::atomic<bool>>(false);
    bool is_active() const { return !*is_stopped; }
  };
  Copy& reference();
  const Copy& reference() const;
  std::size_t active_count() const;
  std::size_t bytes_only_for(std::size_t copy) const;
  std::size_t most_complete() const;
  bool stop(Copy& copy, std::string reason);
  bool stop_lagging(double share);
  void wait_for_drains();
  void compare_with_reference(Copy& copy);
  static void give_up(Copy& copy, const schemas::RecordingDocument::Session& session);

  const Frames frames_;
  std::mutex stop_mutex_;  // held while one copy is stopped: the last one never is
  std::vector<Copy> copies_;
};

}  // namespace raystage::ingest
