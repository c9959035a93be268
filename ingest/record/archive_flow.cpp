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
// The writer looks instead of being called: thousands of calls a second cost more than the writing.
constexpr auto kLookAfter = 5ms;
constexpr int kTurn = 16;  // frames of one camera before the next has its turn

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
    if (write_some()) continue;
    std::this_thread::sleep_for(trouble().empty() ? kLookAfter : kRetryAfter);
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

/// True where something was written.
bool ArchiveFlow::write_some() {
  bool any = false;
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    for (int turn = 0; turn < kTurn; ++turn) {
      const FrameQueue::Frame frame = cameras_[i].queue.front_ready();
      if (!frame) break;
      if (!write(i, *frame)) return any;
      cameras_[i].queue.pop_front();
      any = true;
    }
  }
  return any;
}

bool ArchiveFlow::write(std::size_t camera, const QueuedFrame& frame) {
  try {
    ArchiveWriter& archive = cameras_[camera].archive;
    if (frame.holds_picture()) {
      archive.append(frame.jpeg, frame.time_ns, frame.origin);
      bytes_written_.fetch_add(frame.jpeg.size(), std::memory_order_relaxed);
    } else {
      archive.append_missing(frame.status, frame.time_ns, frame.origin);
    }
  } catch (const Error& error) {
    set_trouble(error.what());
    return false;
  }
  tallies_[camera].count[static_cast<std::size_t>(frame.status)].fetch_add(1);
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
    if (write_some()) {
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
    while (const FrameQueue::Frame frame = queue.front_ready()) {
      if (frame->holds_picture()) {
        frame->become_missing(FrameStatus::kDroppedDiskFull);
        ++cameras_[i].counters.dropped;
      }
      if (!write(i, *frame)) ++cameras_[i].counters.unrecorded;
      queue.pop_front();
    }
  }
}

std::uint64_t ArchiveFlow::written(std::size_t camera, FrameStatus status) const {
  return tallies_[camera].count[static_cast<std::size_t>(status)].load();
}

}  // namespace raystage
