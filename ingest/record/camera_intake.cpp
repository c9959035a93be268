// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/camera_intake.h"

#include <fmt/format.h>

#include <thread>
#include <utility>

#include "ingest/record/picture_check.h"
#include "schemas/error.h"

namespace raystage {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto kPatience = 100ms;  // how soon a stop is noticed
constexpr auto kLookForRoom = 2ms;

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

CameraIntake::CameraIntake(const Settings& settings, std::unique_ptr<FrameSource> source,
                           Open reopen, Plumbing plumbing)
    : settings_(settings),
      source_(std::move(source)),
      reopen_(std::move(reopen)),
      to_(std::move(plumbing)),
      clock_(settings.epoch_utc, settings.last_time),
      reconnect_pause_(settings.reconnect) {}

void CameraIntake::run(const std::stop_token& stop) {
  const std::stop_callback interrupt(stop, [this] {
    const std::scoped_lock lock(source_mutex_);
    if (source_) source_->interrupt();
  });
  stop_ = stop;
  auto opened = Clock::now(), last_frame = opened;
  bool silent = false;
  const auto go_on_after = [&](const std::string& why, bool source_is_gone) {
    reconnect_pause_.worked_for(last_frame - opened);
    const After after = lost(stop, why, source_is_gone);
    if (after == After::kStartAnew) {
      silent = false;
      opened = last_frame = Clock::now();
    }
    return after != After::kFinish;
  };
  while (!stop.stop_requested()) {
    SourceFrame frame;
    switch (source_->next(frame, kPatience)) {
      case FrameSource::Outcome::kFrame:
        if (silent) {
          to_.counters.add_event(
              fmt::format("frames again after {:.1f} s", seconds(Clock::now() - last_frame)));
          to_.counters.state = CameraCounters::State::kRunning;
          silent = false;
        }
        last_frame = Clock::now();
        take(std::move(frame));
        break;
      case FrameSource::Outcome::kNothing:
        if (silent || Clock::now() - last_frame < settings_.lost_after) break;
        silent = true;
        if (!go_on_after(fmt::format("no frame for {:.1f} s", seconds(Clock::now() - last_frame)),
                         false)) {
          return;
        }
        break;
      case FrameSource::Outcome::kEnded:
        to_.counters.state = CameraCounters::State::kEnded;
        return;
      case FrameSource::Outcome::kLost:
        if (stop.stop_requested()) return;
        if (!go_on_after(source_->why_lost(), true)) return;
        break;
    }
  }
}

CameraIntake::After CameraIntake::lost(const std::stop_token& stop, const std::string& why,
                                       bool source_is_gone) {
  to_.counters.state = CameraCounters::State::kLost;
  to_.counters.add_event("lost: " + (why.empty() ? "the source is gone" : why));
  switch (settings_.when_lost) {
    case WhenLost::kStop:
      to_.stop_all();
      return After::kFinish;
    case WhenLost::kReconnect:
      return reconnect(stop) ? After::kStartAnew : After::kFinish;
    case WhenLost::kContinue:
      break;
  }
  // A silent source may come back by itself; one that is gone cannot.
  return source_is_gone ? After::kFinish : After::kGoOn;
}

bool CameraIntake::reconnect(const std::stop_token& stop) {
  const auto start = Clock::now();
  // First of all: most devices serve one at a time.
  exchange_source(nullptr);
  for (;;) {
    pause(stop, reconnect_pause_.next());
    if (stop.stop_requested()) return false;
    try {
      exchange_source(reopen_());
      clock_.forget_device();
      to_.counters.state = CameraCounters::State::kRunning;
      to_.counters.add_event(
          fmt::format("connected again after {:.1f} s", seconds(Clock::now() - start)));
      return true;
    } catch (const Error&) {  // not yet
    }
  }
}

void CameraIntake::pause(const std::stop_token& stop, std::chrono::milliseconds time) {
  std::unique_lock lock(pause_mutex_);
  pause_over_.wait_for(lock, stop, time, [] { return false; });
}

void CameraIntake::exchange_source(std::unique_ptr<FrameSource> source) {
  {
    const std::scoped_lock lock(source_mutex_);
    std::swap(source, source_);
  }
  // The old one, which may take its time, is closed here.
}

FrameStatus CameraIntake::check(const SourceFrame& frame) {
  if (frame.torn) return FrameStatus::kTorn;
  FrameStatus status = FrameStatus::kStored;
  if (!frame.jpeg.empty()) {
    status = check_jpeg(frame.jpeg, settings_.width, settings_.height);
  } else if (frame.raw.width != settings_.width || frame.raw.height != settings_.height) {
    status = FrameStatus::kUnreadable;
  }
  if (status == FrameStatus::kUnreadable && !std::exchange(size_complained_, true)) {
    to_.counters.add_event(fmt::format("frames of another size than {} x {}: they cannot be stored",
                                       settings_.width, settings_.height));
  }
  return status;
}

MemoryBudget::Share CameraIntake::make_room(std::size_t bytes) {
  MemoryBudget::Share share = to_.memory.try_take(bytes);
  if (!share && settings_.wait_for_room > 0ms && room_comes_) share = wait_for_room(bytes);
  room_comes_ = room_comes_ || share;
  while (!share && settings_.drop_oldest && to_.queue.give_up(true, FrameStatus::kDroppedRamFull)) {
    ++to_.counters.dropped;
    share = to_.memory.try_take(bytes);
  }
  return share;
}

MemoryBudget::Share CameraIntake::wait_for_room(std::size_t bytes) {
  const auto deadline = Clock::now() + settings_.wait_for_room;
  MemoryBudget::Share share;
  while (!share && !stop_.stop_requested() && Clock::now() < deadline) {
    std::this_thread::sleep_for(kLookForRoom);
    share = to_.memory.try_take(bytes);
  }
  room_comes_ = static_cast<bool>(share);
  return share;
}

void CameraIntake::take(SourceFrame frame) {
  if (frame.arrival_utc < settings_.start_utc) return;
  ++to_.counters.arrived;
  const Nanoseconds before = clock_.last_time();
  const FrameClock::Stamp stamp = clock_.stamp(frame);
  if (stamp.corrected) ++to_.counters.corrected_times;
  for (std::uint64_t i = 0; i < stamp.skipped; ++i) {
    ++to_.counters.skipped_by_source;
    push_missing(FrameStatus::kDroppedBySource,
                 FrameClock::time_between(before, stamp.time_ns, i, stamp.skipped),
                 {kUnknownTime, stamp.sequence - stamp.skipped + i});
  }
  const FrameOrigin origin{stamp.arrival_ns, stamp.sequence};
  const auto drop = [&](FrameStatus reason) {
    ++to_.counters.dropped;
    push_missing(reason, stamp.time_ns, origin);
  };
  if (const FrameStatus status = check(frame); status != FrameStatus::kStored) return drop(status);

  const bool raw = frame.jpeg.empty();
  auto share =
      make_room(kRecordMemory + (raw ? frame.raw.bytes_in_memory() : frame.jpeg.capacity()));
  if (!share) return drop(FrameStatus::kDroppedRamFull);
  auto queued = std::make_shared<QueuedFrame>();
  queued->stage = raw ? QueuedFrame::Stage::kToEncode : QueuedFrame::Stage::kReady;
  queued->time_ns = stamp.time_ns;
  queued->origin = origin;
  queued->raw = std::move(frame.raw);
  queued->jpeg = std::move(frame.jpeg);
  queued->memory = std::move(share);
  to_.queue.push(std::move(queued));
  if (raw) to_.encoders.encode_one_of(to_.queue);
}

void CameraIntake::push_missing(FrameStatus status, Nanoseconds time, FrameOrigin origin) {
  // Records have a reserve of their own. When even that is used up a frame gives way: a record is
  // worth more, it says what is missing.
  auto share = to_.records.try_take(kRecordMemory);
  if (!share) share = to_.memory.try_take(kRecordMemory);
  if (!share && to_.queue.give_up(settings_.drop_oldest, FrameStatus::kDroppedRamFull)) {
    ++to_.counters.dropped;
    share = to_.memory.try_take(kRecordMemory);
  }
  if (!share) {
    ++to_.counters.unrecorded;
    return;
  }
  auto record = std::make_shared<QueuedFrame>();
  record->status = status;
  record->time_ns = time;
  record->origin = origin;
  record->memory = std::move(share);
  to_.queue.push(std::move(record));
}

}  // namespace raystage
