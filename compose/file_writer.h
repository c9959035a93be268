// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <filesystem>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace raystage::compose {

/// Writes finished files on its own thread, in order, each by write_file_atomically(), so that a
/// slow disk does not block rendering threads.
class FileWriter {
 public:
  struct File {
    std::filesystem::path path;
    std::vector<std::byte> bytes;
  };
  /// Result of one call of write().
  struct WriteResult {
    std::exception_ptr error;  ///< null: all are in place
    std::size_t bytes = 0;
    double seconds = 0;
  };
  /// Called on the writer's thread. Must not throw.
  using Done = std::function<void(const WriteResult&)>;

  /// Starts the thread. `max_queued_calls`: number of calls whose files may wait, in addition to
  /// those being written.
  explicit FileWriter(std::size_t max_queued_calls);
  /// Calls finish().
  ~FileWriter();
  FileWriter(const FileWriter&) = delete;
  FileWriter& operator=(const FileWriter&) = delete;

  /// Queues files. Blocks while the queue is full; returns the seconds that it blocked.
  double write(std::vector<File> files, Done done);
  /// Waits until everything is written. write() must not be called afterwards.
  void finish();

 private:
  struct Job {
    std::vector<File> files;
    Done done;
  };
  void work();

  const std::size_t max_queued_calls_;
  std::mutex mutex_;  ///< of what follows
  std::condition_variable changed_;
  std::deque<Job> queue_;
  bool is_finished_ = false;
  std::thread thread_;  ///< last member: the others exist when it starts
};

}  // namespace raystage::compose
