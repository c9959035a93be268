// SPDX-License-Identifier: Apache-2.0
#include "compose/file_writer.h"

#include <chrono>
#include <utility>

#include "base/atomic_file.h"

namespace raystage {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace

FileWriter::FileWriter(std::size_t max_queued_calls)
    : max_queued_calls_(max_queued_calls), thread_([this] { work(); }) {}

FileWriter::~FileWriter() { finish(); }

double FileWriter::write(std::vector<File> files, Done done) {
  const Clock::time_point start = Clock::now();
  {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return queue_.size() < max_queued_calls_; });
    queue_.push_back({std::move(files), std::move(done)});
  }
  changed_.notify_all();
  return seconds_since(start);
}

void FileWriter::finish() {
  {
    const std::scoped_lock lock(mutex_);
    is_finished_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void FileWriter::work() {
  while (true) {
    Job job;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return !queue_.empty() || is_finished_; });
      if (queue_.empty()) return;
      job = std::move(queue_.front());
      queue_.pop_front();
    }
    changed_.notify_all();
    const Clock::time_point start = Clock::now();
    WriteResult written;
    try {
      for (const File& file : job.files) {
        write_file_atomically(file.path, file.bytes);
        written.bytes += file.bytes.size();
      }
    } catch (...) {
      written.error = std::current_exception();
    }
    written.seconds = seconds_since(start);
    job.done(written);
  }
}

}  // namespace raystage
