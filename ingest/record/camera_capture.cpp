// SPDX-License-Identifier: Apache-2.0
// Moves frames of one source into the queue of its camera. Frames that are torn, late, unreadable
// or too many for the memory budget become records of missing frames.
#include "ingest/record/camera_capture.h"

#include <fmt/format.h>

#include <cmath>
#include <new>
#include <thread>
#include <utility>

#include "base/error.h"
#include "ingest/record/jpeg_frame_check.h"

namespace raystage::ingest {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto kSourceTimeout = 100ms;  // also the longest delay of a stop
constexpr auto kMemoryPollInterval = 2ms;
constexpr auto kRecordTimeout = 2s;

double seconds(Clock::duration duration) { return std::chrono::duration<double>(duration).count(); }

}  // namespace

void CameraCounters::add_event(std::string what) {
  const std::scoped_lock lock(mutex_);
  events_.push_back({host_utc_now(), std::move(what)});
}

std::vector<RecordingEvent> CameraCounters::events() const {
  const std::scoped_lock lock(mutex_);
  return events_;
}

void CameraCounters::set_description(SourceDescription description) {
  const std::scoped_lock lock(mutex_);
  description_ = std::move(description);
}

std::optional<SourceDescription> CameraCounters::description() const {
  const std::scoped_lock lock(mutex_);
  return description_;
}

CameraCapture::CameraCapture(const Options& options, std::unique_ptr<FrameSource> source,
                             Open reopen, Pipeline pipeline)
    : options_(options),
      source_(std::move(source)),
      reopen_(std::move(reopen)),
      pipeline_(std::move(pipeline)),
      clock_(options.epoch_utc, options.last_time),
      reconnect_backoff_(options.reconnect) {
  if (source_) clock_.reset_device(source_->description());
}

void CameraCapture::run(const std::stop_token& stop) {
  const std::stop_callback interrupt(stop, [this] {
    const std::scoped_lock lock(source_mutex_);
    if (source_) source_->interrupt();
  });
  stop_ = stop;
  if (!options_.absence.empty() && !wait_for_absent(stop)) return;
  auto opened = Clock::now(), last_frame = opened;
  bool silent = false;
  const auto handle_loss = [&](const std::string& why, bool source_is_gone) {
    reconnect_backoff_.report_uptime(last_frame - opened);
    const LossOutcome after = lost(stop, why, source_is_gone);
    if (after == LossOutcome::kReconnected) {
      silent = false;
      opened = last_frame = Clock::now();
    }
    return after != LossOutcome::kFinish;
  };
  while (!stop.stop_requested()) {
    SourceFrame frame;
    switch (next_frame(frame)) {
      case FrameSource::Outcome::kFrame:
        if (silent) {
          pipeline_.counters.add_event(fmt::format("frames arrive again after {:.1f} s",
                                                   seconds(Clock::now() - last_frame)));
          pipeline_.counters.state = CameraCounters::State::kRunning;
          silent = false;
        }
        last_frame = Clock::now();
        take(std::move(frame));
        break;
      case FrameSource::Outcome::kNoData:
        if (silent || Clock::now() - last_frame < options_.lost_after) break;
        silent = true;
        if (!handle_loss(fmt::format("no frame for {:.1f} s", seconds(Clock::now() - last_frame)),
                         false)) {
          return;
        }
        break;
      case FrameSource::Outcome::kEnded:
        pipeline_.counters.state = CameraCounters::State::kEnded;
        return;
      case FrameSource::Outcome::kLost:
        if (stop.stop_requested()) return;
        if (!handle_loss(source_->loss_reason(), true)) return;
        break;
    }
  }
}

CameraCapture::LossOutcome CameraCapture::lost(const std::stop_token& stop, const std::string& why,
                                               bool source_is_gone) {
  pipeline_.counters.state = CameraCounters::State::kLost;
  pipeline_.counters.add_event("lost: " + (why.empty() ? "the source is gone" : why));
  switch (options_.when_lost) {
    case LostSourcePolicy::kStop:
      pipeline_.stop_recording();
      return LossOutcome::kFinish;
    case LostSourcePolicy::kReconnect:
      return reconnect(stop, "connected again") ? LossOutcome::kReconnected : LossOutcome::kFinish;
    case LostSourcePolicy::kContinue:
      break;
  }
  // A source that only stalls may recover by itself.
  return source_is_gone ? LossOutcome::kFinish : LossOutcome::kContinueWaiting;
}

bool CameraCapture::wait_for_absent(const std::stop_token& stop) {
  pipeline_.counters.state = CameraCounters::State::kLost;
  pipeline_.counters.add_event("lost: absent at the start: " + options_.absence);
  if (options_.when_lost == LostSourcePolicy::kStop) {
    pipeline_.stop_recording();
    return false;
  }
  return reconnect(stop, "connected");
}

bool CameraCapture::has_size_of_archive(const SourceDescription& source) {
  if (source.width == options_.width && source.height == options_.height) return true;
  // A source without a size has delivered no picture: it is tried again.
  if (source.width <= 0 || source.height <= 0) return false;
  if (!std::exchange(size_warning_given_, true)) {
    pipeline_.counters.add_event(
        fmt::format("the source delivers {} x {} pixels, the take has {} x {}: it is not recorded",
                    source.width, source.height, options_.width, options_.height));
  }
  return false;
}

bool CameraCapture::reconnect(const std::stop_token& stop, std::string_view connected) {
  const auto start = Clock::now();
  replace_source(nullptr);  // most devices accept one connection at a time
  for (;;) {
    pause(stop, reconnect_backoff_.next());
    if (stop.stop_requested()) return false;
    try {
      std::unique_ptr<FrameSource> source = reopen_();
      const SourceDescription description = source->description();
      if (!has_size_of_archive(description)) continue;
      replace_source(std::move(source));
      pipeline_.counters.set_description(description);
      pipeline_.counters.is_absent = false;
      clock_.reset_device(description);
      pipeline_.counters.state = CameraCounters::State::kRunning;
      pipeline_.counters.add_event(
          fmt::format("{} after {:.1f} s", connected, seconds(Clock::now() - start)));
      return true;
    } catch (const std::exception&) {  // tried again after the next pause
    }
  }
}

void CameraCapture::pause(const std::stop_token& stop, std::chrono::milliseconds time) {
  std::unique_lock lock(pause_mutex_);
  pause_ended_.wait_for(lock, stop, time, [] { return false; });
}

void CameraCapture::replace_source(std::unique_ptr<FrameSource> source) {
  {
    const std::scoped_lock lock(source_mutex_);
    std::swap(source, source_);
  }
  // The old source is closed here, outside of the lock, because that may take long.
}

FrameSource::Outcome CameraCapture::next_frame(SourceFrame& frame) {
  try {
    return source_->next(frame, kSourceTimeout);
  } catch (const std::bad_alloc&) {  // the frame is still to come
    frame = {};
    std::this_thread::sleep_for(kMemoryPollInterval);
    return FrameSource::Outcome::kNoData;
  }
}

store::FrameStatus CameraCapture::check(const SourceFrame& frame) {
  if (frame.no_memory) return store::FrameStatus::kDroppedMemoryCeiling;
  if (frame.torn) return store::FrameStatus::kTorn;
  store::FrameStatus status = store::FrameStatus::kStored;
  if (!frame.jpeg.empty()) {
    status = check_jpeg_frame(frame.jpeg, options_.width, options_.height);
  } else if (frame.raw.width != options_.width || frame.raw.height != options_.height) {
    status = store::FrameStatus::kUnreadable;
  }
  if (status == store::FrameStatus::kUnreadable && !std::exchange(size_warning_given_, true)) {
    pipeline_.counters.add_event(
        fmt::format("frames of another size than {} x {} pixels cannot be stored", options_.width,
                    options_.height));
  }
  return status;
}

/// Adds an event for the first step of each clock and the first jump of the device's counter. A
/// faulty device may have one with every frame.
void CameraCapture::report_steps(const FrameTimestamper::Stamp& stamp) {
  const Nanoseconds ignored = pipeline_.host_clock.ignored_steps();
  if (ignored != 0 && !std::exchange(host_step_reported_, true)) {
    pipeline_.counters.add_event(fmt::format(
        "this computer's clock was set {:.1f} s {}: times go on as if it had not been",
        std::abs(static_cast<double>(ignored)) / kNsPerS, ignored > 0 ? "ahead" : "back"));
  }
  if (stamp.clock_stepped && !std::exchange(clock_step_reported_, true)) {
    pipeline_.counters.add_event(
        "the device's clock stepped by more than a minute: it is aligned to the host's clock again "
        "(further steps are only counted, as corrected time stamps)");
  }
  if (stamp.counter_jumped && !std::exchange(counter_jump_reported_, true)) {
    pipeline_.counters.add_event(
        fmt::format("the device's frame counter jumped to {}, by more than it can have dropped: no "
                    "frames count as dropped for that, nor for further such jumps",
                    stamp.sequence));
  }
}

MemoryBudget::Reservation CameraCapture::reserve_memory(std::size_t bytes) {
  MemoryBudget::Reservation reservation = pipeline_.memory.try_reserve(bytes);
  if (!reservation && pipeline_.free_memory && pipeline_.free_memory())
    reservation = pipeline_.memory.try_reserve(bytes);
  if (!reservation && options_.wait_for_memory > 0ms && memory_was_freed_)
    reservation = wait_for_memory(bytes);
  memory_was_freed_ = memory_was_freed_ || reservation;
  while (!reservation && options_.drop_oldest &&
         pipeline_.queue.drop_one(true, store::FrameStatus::kDroppedRamFull)) {
    ++pipeline_.counters.dropped;
    reservation = pipeline_.memory.try_reserve(bytes);
  }
  return reservation;
}

MemoryBudget::Reservation CameraCapture::wait_for_memory(std::size_t bytes) {
  const auto deadline = Clock::now() + options_.wait_for_memory;
  MemoryBudget::Reservation reservation;
  while (!reservation && !stop_.stop_requested() && Clock::now() < deadline) {
    std::this_thread::sleep_for(kMemoryPollInterval);
    reservation = pipeline_.memory.try_reserve(bytes);
  }
  memory_was_freed_ = static_cast<bool>(reservation);
  return reservation;
}

void CameraCapture::take(SourceFrame frame) {
  const Nanoseconds arrival_utc = pipeline_.host_clock.utc_at(frame.arrival_steady);
  if (arrival_utc < options_.start_utc) return;
  ++pipeline_.counters.arrived;
  const Nanoseconds before = clock_.last_time();
  const FrameTimestamper::Stamp stamp = clock_.stamp(frame, arrival_utc);
  if (stamp.corrected) ++pipeline_.counters.corrected_timestamps;
  report_steps(stamp);
  for (std::uint64_t i = 0; i < stamp.skipped; ++i) {
    ++pipeline_.counters.skipped_by_source;
    push_missing_record(store::FrameStatus::kDroppedBySource,
                        FrameTimestamper::interpolate_time(before, stamp.time_ns, i, stamp.skipped),
                        {store::kUnknownTime, stamp.sequence - stamp.skipped + i});
  }
  const store::FrameOrigin origin{stamp.arrival_ns, stamp.sequence};
  const auto drop = [&](store::FrameStatus reason) {
    ++pipeline_.counters.dropped;
    push_missing_record(reason, stamp.time_ns, origin);
  };
  if (const store::FrameStatus status = check(frame); status != store::FrameStatus::kStored)
    return drop(status);

  if (!pipeline_.memory.is_open()) return drop(store::FrameStatus::kDroppedMemoryCeiling);
  auto reservation =
      reserve_memory(kMissingRecordBytes +
                     (frame.jpeg.empty() ? frame.raw.bytes_in_memory() : frame.jpeg.capacity()));
  if (!reservation) return drop(store::FrameStatus::kDroppedRamFull);
  if (push(frame, stamp, std::move(reservation))) return;
  frame = {};  // the record of it needs memory
  drop(store::FrameStatus::kDroppedMemoryCeiling);
}

/// Puts a frame into the queue. Returns false if there is no memory for that.
bool CameraCapture::push(SourceFrame& frame, const FrameTimestamper::Stamp& stamp,
                         MemoryBudget::Reservation reservation) {
  const bool raw = frame.jpeg.empty();
  const store::FrameOrigin origin{stamp.arrival_ns, stamp.sequence};
  try {
    auto queued = std::make_shared<QueuedFrame>();
    queued->stage = raw ? QueuedFrame::Stage::kToEncode : QueuedFrame::Stage::kReady;
    queued->time_ns = stamp.time_ns;
    queued->origin = origin;
    queued->raw = std::move(frame.raw);
    queued->jpeg = std::move(frame.jpeg);
    queued->memory = std::move(reservation);
    pipeline_.queue.push(std::move(queued));
  } catch (const std::bad_alloc&) {
    return false;
  }
  if (raw) pipeline_.encoders.encode_next(pipeline_.queue);
  return true;
}

void CameraCapture::push_missing_record(store::FrameStatus status, Nanoseconds time,
                                        store::FrameOrigin origin) {
  // Records have their own budget. If it is used up, a frame is dropped instead: the record of a
  // missing frame is worth more than a frame.
  auto reservation = pipeline_.records.try_reserve(kMissingRecordBytes);
  if (!reservation) reservation = pipeline_.memory.try_reserve(kMissingRecordBytes);
  if (!reservation &&
      pipeline_.queue.drop_one(options_.drop_oldest, store::FrameStatus::kDroppedRamFull)) {
    ++pipeline_.counters.dropped;
    reservation = pipeline_.memory.try_reserve(kMissingRecordBytes);
  }
  if (!reservation) {
    ++pipeline_.counters.unrecorded;
    return;
  }
  // At the memory ceiling a record waits for memory: few bytes, which frames that are written free.
  for (const auto deadline = Clock::now() + kRecordTimeout;;) {
    try {
      auto record = std::make_shared<QueuedFrame>();
      record->status = status;
      record->time_ns = time;
      record->origin = origin;
      std::swap(record->memory, reservation);
      try {
        pipeline_.queue.push(record);
      } catch (const std::bad_alloc&) {
        std::swap(record->memory, reservation);
        throw;
      }
      return;
    } catch (const std::bad_alloc&) {
      if (Clock::now() > deadline) break;
    }
    std::this_thread::sleep_for(kMemoryPollInterval);
  }
  ++pipeline_.counters.unrecorded;
}

}  // namespace raystage::ingest
