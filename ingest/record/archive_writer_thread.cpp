// SPDX-License-Identifier: Apache-2.0
// Writes queued frames to the archives in batches, and flushes them to the disk at intervals. An
// archive that rejects frames is retried later and does not delay the others.
#include "ingest/record/archive_writer_thread.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <new>
#include <utility>

#include "base/error.h"

namespace raystage::ingest {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto kRetryInterval = 100ms;  // of an archive that refused a write
constexpr auto kDrainPollInterval = 5ms;
// The writer polls, because thousands of notifications per second cost more than the writing, and
// several frames of a camera in one batch cost little more than one.
constexpr auto kPollInterval = 30ms;
constexpr auto kPollIntervalUnderPressure = 5ms;
// Frames of one camera before those of the next.
constexpr std::size_t kBatchFrames = store::kMaxBatchFrames;

}  // namespace

std::string exception_message(const std::function<void()>& attempt) {
  try {
    attempt();
  } catch (const std::exception& error) {
    try {
      return error.what();
    } catch (const std::bad_alloc&) {
      return "no memory";  // short enough to need none
    }
  }
  return {};
}

ArchiveWriterThread::ArchiveWriterThread(std::vector<Camera> cameras, Options options)
    : cameras_(std::move(cameras)),
      options_(std::move(options)),
      written_counts_(cameras_.size()),
      retry_states_(cameras_.size()),
      write_errors_(cameras_.size()) {
  if (options_.hold) return;
  writer_ = std::jthread([this](const std::stop_token& stop) { write_loop(stop); });
  if (options_.flush_interval_s > 0) {
    flusher_ = std::jthread([this](const std::stop_token& stop) { flush_loop(stop); });
  }
}

ArchiveWriterThread::~ArchiveWriterThread() = default;

void ArchiveWriterThread::write_loop(const std::stop_token& stop) {
  while (!stop.stop_requested() && !stopped_) {
    if (write_pending() != WriteResult::kSome) wait_before_next_pass(stop);
  }
}

void ArchiveWriterThread::wait_before_next_pass(const std::stop_token& stop) {
  if (options_.memory == nullptr || options_.memory->is_under_pressure()) {
    std::this_thread::sleep_for(kPollIntervalUnderPressure);
  } else {
    options_.memory->wait_for_pressure(stop, kPollInterval);
  }
}

void ArchiveWriterThread::flush_loop(const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any never;
  const auto interval = std::chrono::duration<double>(options_.flush_interval_s);
  std::unique_lock lock(mutex);
  while (!never.wait_for(lock, stop, interval, [] { return false; }) && !stop.stop_requested()) {
    for (std::size_t i = 0; i < cameras_.size() && !stopped_; ++i) {
      const std::string failure = exception_message([&] { cameras_[i].archive.flush(); });
      if (failure.empty()) continue;
      set_write_error(i, failure);
      const std::scoped_lock failure_lock(write_error_mutex_);
      if (flush_failure_.empty()) flush_failure_ = failure;
    }
  }
}

/// Writes one batch of each camera. Returns kSome if more frames wait and the disk accepts them. An
/// archive that refuses (its file may have reached the size limit) does not delay the others.
ArchiveWriterThread::WriteResult ArchiveWriterThread::write_pending() {
  WriteResult wrote = WriteResult::kNothing;
  bool more = false;
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    if (Clock::now() < retry_states_[i].retry_at) continue;
    const BatchResult turn = write_batch(i);
    if (turn.written > 0) {
      wrote = WriteResult::kAll;
      retry_states_[i].last_write = Clock::now();
    }
    if (turn.refused) retry_states_[i].retry_at = Clock::now() + kRetryInterval;
    more = more || turn.written == kBatchFrames;
  }
  return more ? WriteResult::kSome : wrote;
}

/// Writes frames at the front of a camera's queue, at most kBatchFrames.
ArchiveWriterThread::BatchResult ArchiveWriterThread::write_batch(std::size_t camera) {
  FrameQueue& queue = cameras_[camera].queue;
  std::vector<FrameQueue::Frame> frames;
  const std::string write_error =
      exception_message([&] { frames = queue.start_writing(kBatchFrames, options_.writer); });
  if (!write_error.empty()) {
    set_write_error(camera, write_error);
    return {0, true};
  }
  if (frames.empty()) return {};
  const std::size_t written = write(camera, frames);
  queue.finish_writing(written, options_.writer);
  return {written, written < frames.size()};
}

/// Writes all frames, or as many as fit. Returns their number.
std::size_t ArchiveWriterThread::write(std::size_t camera,
                                       std::span<const FrameQueue::Frame> frames) {
  const AppendResult result = append(camera, frames);
  if (result == AppendResult::kWritten) return frames.size();
  std::size_t written = 0;
  if (frames.size() == 1) {
    if (result == AppendResult::kRejected && record_rejected(camera, *frames[0])) ++written;
  } else {
    while (written < frames.size() && write(camera, frames.subspan(written, 1)) == 1) ++written;
  }
  return written;
}

/// Records a frame that the archive rejects as dropped, at the time of the last record. Returns
/// false if the disk does not accept that.
bool ArchiveWriterThread::record_rejected(std::size_t camera, QueuedFrame& frame) {
  const Camera& rejecting = cameras_[camera];
  std::string reason;
  exception_message([&] {
    const std::scoped_lock lock(write_error_mutex_);
    reason = write_errors_[camera];
  });
  QueuedFrame missing;
  missing.status = frame.has_image() ? store::FrameStatus::kDroppedDiskFull : frame.status;
  missing.time_ns = std::max<Nanoseconds>(0, rejecting.archive.last_time());
  missing.origin = frame.origin;
  const std::array<FrameQueue::Frame, 1> record{FrameQueue::Frame(FrameQueue::Frame(), &missing)};
  const AppendResult result = append(camera, record);
  if (result == AppendResult::kFailed) return false;
  if (frame.is_counted_as_dropped.exchange(true)) return true;  // each copy rejects the frame
  if (frame.has_image()) ++rejecting.counters.dropped;
  if (result == AppendResult::kRejected) ++rejecting.counters.unrecorded;
  if (!std::exchange(retry_states_[camera].rejection_reported, true)) {
    exception_message([&] { rejecting.counters.add_event("a frame was rejected: " + reason); });
  }
  return true;
}

ArchiveWriterThread::AppendResult ArchiveWriterThread::append(
    std::size_t camera, std::span<const FrameQueue::Frame> frames) {
  std::uint64_t bytes = 0;
  bool is_rejected = false;
  std::string write_error = exception_message([&] {
    std::vector<store::NewFrame> batch;
    for (const auto& frame : frames) {
      batch.push_back({frame->time_ns, frame->jpeg, frame->status, frame->origin});
      bytes += frame->jpeg.size();
    }
    try {
      cameras_[camera].archive.append(batch);
    } catch (const Error& error) {
      is_rejected = error.exit_code() == ExitCode::kBadInput;
      throw;
    }
  });
  const bool written = write_error.empty();
  set_write_error(camera, std::move(write_error));
  if (!written) return is_rejected ? AppendResult::kRejected : AppendResult::kFailed;
  bytes_written_.fetch_add(bytes, std::memory_order_relaxed);
  for (const auto& frame : frames) {
    written_counts_[camera].count[static_cast<std::size_t>(frame->status)].fetch_add(1);
  }
  return AppendResult::kWritten;
}

void ArchiveWriterThread::set_write_error(std::size_t camera, std::string text) {
  const std::scoped_lock lock(write_error_mutex_);
  write_errors_[camera] = std::move(text);
}

std::string ArchiveWriterThread::write_error() const {
  const std::scoped_lock lock(write_error_mutex_);
  const auto found =
      std::ranges::find_if(write_errors_, [](const std::string& text) { return !text.empty(); });
  return found == write_errors_.end() ? std::string() : *found;
}

std::string ArchiveWriterThread::flush_error() const {
  const std::scoped_lock lock(write_error_mutex_);
  return flush_failure_;
}

std::size_t ArchiveWriterThread::waiting() const {
  std::size_t sum = 0;
  for (const Camera& camera : cameras_) sum += camera.queue.size(options_.writer);
  return sum;
}

void ArchiveWriterThread::drain(const std::function<void(double)>& progress) {
  if (!write_remaining(progress)) drop_remaining();
}

bool ArchiveWriterThread::write_remaining(const std::function<void(double)>& progress) {
  writer_ = {};  // joins: from here on the calling thread writes
  flusher_ = {};
  const std::size_t all = waiting();
  for (RetryState& turns : retry_states_) {
    turns.last_write = Clock::now();
    turns.retry_at = {};
  }
  while (const std::size_t left = waiting()) {
    if (progress) progress(1 - static_cast<double>(left) / static_cast<double>(all));
    if (write_pending() != WriteResult::kNothing) continue;
    if (drain_timed_out()) return false;
    std::this_thread::sleep_for(kDrainPollInterval);
  }
  if (progress) progress(1);
  return true;
}

void ArchiveWriterThread::stop() {
  stopped_ = true;
  for (const Camera& camera : cameras_) camera.queue.stop_writer(options_.writer);
}

/// Returns true if all cameras that still have frames timed out. While one of them can still write,
/// the reserved disk space is not used for another.
bool ArchiveWriterThread::drain_timed_out() const {
  const auto drain_timeout_s = std::chrono::duration<double>(options_.drain_timeout_s);
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    if (cameras_[i].queue.empty(options_.writer)) continue;
    if (Clock::now() - retry_states_[i].last_write <= drain_timeout_s) return false;
  }
  return true;
}

/// Turns the remaining frames into records of dropped frames, for which disk space is reserved.
/// Until the reserve is needed each frame is tried once more: a smaller one may fit.
void ArchiveWriterThread::drop_remaining() {
  bool reserve_is_whole = true;
  // A stopped writer whose disk hangs may still read a frame, which is thus left as it is. The
  // record is no allocation: there may be no memory.
  QueuedFrame missing;
  const std::array<FrameQueue::Frame, 1> record_of_missing{
      FrameQueue::Frame(FrameQueue::Frame(), &missing)};
  const auto with_reserve = [&](const auto& write) {
    if (write()) return true;
    if (!std::exchange(reserve_is_whole, false)) return false;
    options_.release_reserved_space();
    return write();
  };
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    FrameQueue& queue = cameras_[i].queue;
    const auto next = [&] { return queue.start_writing(1, options_.writer); };
    for (auto front = next(); !front.empty(); front = next()) {
      QueuedFrame& frame = *front[0];
      const bool picture = frame.has_image();
      auto result = picture && reserve_is_whole ? append(i, front) : AppendResult::kFailed;
      bool is_recorded = true;
      if (result == AppendResult::kFailed) {
        missing.status = picture ? store::FrameStatus::kDroppedDiskFull : frame.status;
        missing.time_ns = frame.time_ns;
        missing.origin = frame.origin;
        if (picture && !frame.is_counted_as_dropped.exchange(true)) ++cameras_[i].counters.dropped;
        is_recorded = with_reserve([&] {
          result = append(i, record_of_missing);
          return result != AppendResult::kFailed;
        });
      }
      // No disk space helps against a time that no archive holds.
      if (result == AppendResult::kRejected) {
        is_recorded = with_reserve([&] { return record_rejected(i, frame); });
      }
      if (!is_recorded) ++cameras_[i].counters.unrecorded;
      queue.finish_writing(1, options_.writer);
    }
  }
}

std::uint64_t ArchiveWriterThread::written(std::size_t camera, store::FrameStatus status) const {
  return written_counts_[camera].count[static_cast<std::size_t>(status)].load();
}

}  // namespace raystage::ingest
