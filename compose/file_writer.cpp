// SPDX-License-Identifier: Apache-2.0
#include "compose/file_writer.h"

#include <utility>

#include "base/atomic_file.h"
#include "base/stopwatch.h"

namespace raystage::compose {

FileWriter::FileWriter(std::size_t max_queued_calls)
    : max_queued_calls_(max_queued_calls), thread_([this] { work(); }) {}

FileWriter::~FileWriter() { finish(); }

double FileWriter::write(std::vector<File> files, Done done) {
  const Stopwatch watch;
  {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return queue_.size() < max_queued_calls_; });
    queue_.push_back({std::move(files), std::move(done)});
  }
  changed_.notify_all();
  return watch.seconds();
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
    const Stopwatch watch;
    WriteResult written;
    try {
      for (const File& file : job.files) {
        write_file_atomically(file.path, file.bytes);
        written.bytes += file.bytes.size();
      }
    } catch (...) {
      written.error = std::current_exception();
    }
    written.seconds = watch.seconds();
    job.done(written);
  }
}

}  // namespace raystage::compose
