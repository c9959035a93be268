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

namespace raystage {

/// Writes finished files on a thread of its own, in order, each as write_file_atomically(): a disk
/// that takes its time holds up none of the threads that render.
class FileWriter {
 public:
  struct File {
    std::filesystem::path path;
    std::vector<std::byte> bytes;
  };
  /// What became of the files of one call.
  struct Written {
    std::exception_ptr error;  ///< null: all are in place
    std::size_t bytes = 0;
    double seconds = 0;
  };
  /// Called on the writer's thread. Must not throw.
  using Done = std::function<void(const Written&)>;

  /// Besides those being written, files of `most_waiting` calls wait at most.
  explicit FileWriter(std::size_t most_waiting);
  /// As finish().
  ~FileWriter();
  FileWriter(const FileWriter&) = delete;
  FileWriter& operator=(const FileWriter&) = delete;

  /// Holds the caller up only while the queue is full; for how many seconds it returns.
  double write(std::vector<File> files, Done done);
  /// Waits until everything is written. Nothing more may come.
  void finish();

 private:
  struct Job {
    std::vector<File> files;
    Done done;
  };
  void work();

  const std::size_t most_waiting_;
  std::mutex mutex_;  ///< of what follows
  std::condition_variable changed_;
  std::deque<Job> waiting_;
  bool is_finished_ = false;
  std::thread thread_;  ///< last: the others are there when it begins
};

}  // namespace raystage
