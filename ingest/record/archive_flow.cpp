// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/archive_flow.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <utility>

#include "schemas/error.h"

namespace raystage {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto kRetryAfter = 100ms;  // while the disk refuses
// The writer looks instead of being called, and seldom: thousands of calls a second cost more than
// the writing, and several frames of a camera in one go cost little more than one.
constexpr auto kLookAfter = 30ms;
constexpr auto kLookAfterWhenTight = 5ms;
constexpr std::size_t kTurn = 16;  // frames of one camera before the next has its turn

}  // namespace

ArchiveFlow::ArchiveFlow(std::vector<Camera> cameras, Settings settings)
    : cameras_(std::move(cameras)), settings_(std::move(settings)), tallies_(cameras_.size()) {
  if (settings_.hold) return;
  writer_ = std::jthread([this](const std::stop_token& stop) { write_on(stop); });
  if (settings_.flush_every > 0) {
    flusher_ = std::jthread([this](const std::stop_token& stop) { flush_on(stop); });
  }
}

ArchiveFlow::~ArchiveFlow() = default;

void ArchiveFlow::write_on(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    if (write_some() != Wrote::kSome) rest(stop);
  }
}

void ArchiveFlow::rest(const std::stop_token& stop) {
  if (!trouble().empty()) {
    std::this_thread::sleep_for(kRetryAfter);
  } else if (settings_.memory == nullptr || settings_.memory->is_tight()) {
    std::this_thread::sleep_for(kLookAfterWhenTight);
  } else {
    settings_.memory->wait_while_roomy(stop, kLookAfter);
  }
}

void ArchiveFlow::flush_on(const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any never;
  const auto interval = std::chrono::duration<double>(settings_.flush_every);
  std::unique_lock lock(mutex);
  while (!never.wait_for(lock, stop, interval, [] { return false; }) && !stop.stop_requested()) {
    for (const Camera& camera : cameras_) {
      try {
        camera.archive.flush();
      } catch (const Error& error) {
        set_trouble(error.what());
        const std::scoped_lock failure_lock(trouble_mutex_);
        if (flush_failure_.empty()) flush_failure_ = error.what();
      }
    }
  }
}

/// One turn for each camera; kSome where there is more to write, and the disk takes it.
ArchiveFlow::Wrote ArchiveFlow::write_some() {
  Wrote wrote = Wrote::kNothing;
  bool more = false;
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    FrameQueue& queue = cameras_[i].queue;
    const auto frames = queue.start_writing(kTurn);
    if (frames.empty()) continue;
    const std::size_t written = write(i, frames);
    queue.finish_writing(written);
    if (written > 0) wrote = Wrote::kAll;
    if (written < frames.size()) return wrote;
    more = more || written == kTurn;
  }
  return more ? Wrote::kSome : wrote;
}

/// How many of the frames are on disk: all, or as many as fit.
std::size_t ArchiveFlow::write(std::size_t camera, std::span<const FrameQueue::Frame> frames) {
  if (append(camera, frames)) return frames.size();
  std::size_t written = 0;
  if (frames.size() == 1) return written;
  while (written < frames.size() && append(camera, frames.subspan(written, 1))) ++written;
  return written;
}

bool ArchiveFlow::append(std::size_t camera, std::span<const FrameQueue::Frame> frames) {
  std::vector<NewFrame> batch;
  std::uint64_t bytes = 0;
  for (const auto& frame : frames) {
    batch.push_back({frame->time_ns, frame->jpeg, frame->status, frame->origin});
    bytes += frame->jpeg.size();
  }
  try {
    cameras_[camera].archive.append(batch);
  } catch (const Error& error) {
    set_trouble(error.what());
    return false;
  }
  bytes_written_.fetch_add(bytes, std::memory_order_relaxed);
  for (const auto& frame : frames) {
    tallies_[camera].count[static_cast<std::size_t>(frame->status)].fetch_add(1);
  }
  set_trouble({});
  return true;
}

void ArchiveFlow::set_trouble(std::string text) {
  const std::scoped_lock lock(trouble_mutex_);
  trouble_ = std::move(text);
}

std::string ArchiveFlow::trouble() const {
  const std::scoped_lock lock(trouble_mutex_);
  return trouble_;
}

std::string ArchiveFlow::flush_failure() const {
  const std::scoped_lock lock(trouble_mutex_);
  return flush_failure_;
}

std::size_t ArchiveFlow::waiting() const {
  std::size_t sum = 0;
  for (const Camera& camera : cameras_) sum += camera.queue.size();
  return sum;
}

void ArchiveFlow::drain(const std::function<void(double)>& progress) {
  writer_ = {};  // joins: from here on this thread writes
  flusher_ = {};
  const std::size_t all = waiting();
  auto last_success = Clock::now();
  while (const std::size_t left = waiting()) {
    if (progress) progress(1 - static_cast<double>(left) / static_cast<double>(all));
    if (write_some() != Wrote::kNothing) {
      last_success = Clock::now();
      continue;
    }
    if (Clock::now() - last_success > std::chrono::duration<double>(settings_.patience)) {
      give_up_rest();
      break;
    }
    std::this_thread::sleep_for(kRetryAfter);
  }
  if (progress) progress(1);
}

/// The disk refuses for good: what is left becomes records, for which there is a reserve.
void ArchiveFlow::give_up_rest() {
  settings_.release_reserve();
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    FrameQueue& queue = cameras_[i].queue;
    for (auto front = queue.start_writing(1); !front.empty(); front = queue.start_writing(1)) {
      if (front[0]->holds_picture()) {
        front[0]->become_missing(FrameStatus::kDroppedDiskFull);
        ++cameras_[i].counters.dropped;
      }
      if (!append(i, front)) ++cameras_[i].counters.unrecorded;
      queue.finish_writing(1);
    }
  }
}

std::uint64_t ArchiveFlow::written(std::size_t camera, FrameStatus status) const {
  return tallies_[camera].count[static_cast<std::size_t>(status)].load();
}

}  // namespace raystage
