// SPDX-License-Identifier: Apache-2.0
#include "testing/ingest/scripted_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <set>
#include <utility>

#include "base/error.h"
#include "ingest/sources/interruptible_wait.h"
#include "ingest/sources/jpeg_markers.h"

namespace raystage::testing {
namespace {

using Clock = ingest::InterruptibleWait::Clock;

std::chrono::nanoseconds nanoseconds(double seconds) {
  return std::chrono::nanoseconds(std::llround(seconds * kNanosecondsPerSecond));
}

/// Returns a pseudo-random number in [0, 1) that depends only on the exposure.
double hashed(std::uint64_t exposure) {
  std::uint64_t x = (exposure + 1) * 0x9E3779B97F4A7C15ULL;
  x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  x ^= x >> 31U;
  return static_cast<double>(x >> 11U) * 0x1p-53;
}

class MemorySource final : public ingest::FrameSource {
 public:
  explicit MemorySource(SourceScript script) : script_(std::move(script)) {
    const ingest::SourceFrame& first = script_.frames.front();
    description_.what = "frames in memory";
    description_.delivers_jpeg = !first.jpeg.empty();
    const ingest::JpegMarkerInfo markers = ingest::scan_jpeg_markers(first.jpeg);
    description_.width = description_.delivers_jpeg ? markers.width : first.raw.width;
    description_.height = description_.delivers_jpeg ? markers.height : first.raw.height;
    description_.fps = script_.fps;
    description_.clock = script_.stamps ? "device" : "host";
    description_.timestamp_event = script_.timestamp_event;
  }

  const ingest::SourceDescription& description() const override { return description_; }

  Outcome next(ingest::SourceFrame& frame, std::chrono::milliseconds patience) override {
    const Clock::time_point deadline = Clock::now() + patience;
    if (!started_) start_ = Clock::now();
    started_ = true;
    for (;;) {
      expose(Clock::now());
      if (!held_.empty()) {
        deliver(frame);
        return Outcome::kFrame;
      }
      if (!loss_reason_.empty()) return Outcome::kLost;
      if (script_.count && exposure_ >= *script_.count) return Outcome::kEnded;
      const Clock::time_point due = std::max(time_of(exposure_), stalled_until_);
      if (!wait_.until(std::min(due, deadline)) || due > deadline) return Outcome::kNoData;
    }
  }

  std::string loss_reason() const override { return loss_reason_; }
  void interrupt() override { wait_.interrupt(); }

 private:
  struct BufferedFrame {
    std::uint64_t exposure = 0;
    const ingest::SourceFrame* shown = nullptr;
    bool torn = false;
  };

  /// Exposes all frames until `now`; without a rate, one frame if none waits.
  void expose(Clock::time_point now) {
    const bool paced = script_.fps > 0;
    while (paced || held_.empty()) {
      const bool torn = play_events();
      const bool over = script_.count && exposure_ >= *script_.count;
      if (over || !loss_reason_.empty() || time_of(exposure_) > now) return;
      if (now < stalled_until_ && !paced) return;
      const bool stalled = time_of(exposure_) < stalled_until_;
      const bool full =
          script_.buffers > 0 && held_.size() >= static_cast<std::size_t>(script_.buffers);
      if (!stalled && !full) {
        held_.push_back({exposure_, &(*frames_)[captured_ % frames_->size()], torn});
        ++captured_;
      }
      ++exposure_;
    }
  }

  /// Plays the events before the next exposure; returns true if it is torn.
  bool play_events() {
    while (event_ < script_.events.size() && script_.events[event_].at <= exposure_) {
      const SourceScript::Event& event = script_.events[event_];
      if (const auto* stall = std::get_if<SourceScript::Stall>(&event.what)) {
        const Clock::time_point from = script_.fps > 0 ? time_of(event.at) : Clock::now();
        stalled_until_ = from + nanoseconds(stall->seconds);
      } else if (const auto* death = std::get_if<SourceScript::Death>(&event.what)) {
        loss_reason_ = death->why.empty() ? "lost as scripted" : death->why;
        return false;
      } else if (const auto* gap = std::get_if<SourceScript::Gap>(&event.what)) {
        exposure_ += gap->count;
      } else if (const auto* change = std::get_if<SourceScript::Change>(&event.what)) {
        frames_ = &change->frames;
        captured_ = 0;
      } else if (event.at == exposure_ && tears_.emplace(exposure_).second) {
        // tears_ keeps the event for repeated calls before the exposure's time.
      }
      ++event_;
    }
    return tears_.contains(exposure_);
  }

  Clock::time_point time_of(std::uint64_t exposure) const {
    if (script_.fps <= 0) return start_;
    const double late = script_.jitter * hashed(exposure);
    return start_ + nanoseconds(static_cast<double>(exposure) / script_.fps + late);
  }

  void deliver(ingest::SourceFrame& frame) {
    const BufferedFrame held = held_.front();
    held_.pop_front();
    frame.jpeg = held.shown->jpeg;
    frame.raw = held.shown->raw;
    frame.torn = held.torn;
    if (held.torn) frame.jpeg.resize(frame.jpeg.size() / 2);
    frame.arrival_steady = ingest::host_steady_now();
    frame.device_time.reset();
    frame.sequence.reset();
    if (!script_.stamps) return;
    frame.sequence = held.exposure;
    const double seconds = script_.fps > 0
                               ? static_cast<double>(held.exposure) / script_.fps
                               : std::chrono::duration<double>(Clock::now() - start_).count();
    frame.device_time = nanoseconds(seconds * (1 + script_.clock_ppm * 1e-6)).count();
  }

  SourceScript script_;
  ingest::SourceDescription description_;
  ingest::InterruptibleWait wait_;
  Clock::time_point start_, stalled_until_;
  bool started_ = false;
  const std::vector<ingest::SourceFrame>* frames_ = &script_.frames;
  std::deque<BufferedFrame> held_;
  std::set<std::uint64_t> tears_;
  std::size_t event_ = 0, captured_ = 0;
  std::uint64_t exposure_ = 0;
  std::string loss_reason_;
};

void check(const std::vector<ingest::SourceFrame>& frames) {
  for (const ingest::SourceFrame& frame : frames) {
    if (!frame.jpeg.empty() || frame.raw.planes[0].data != nullptr) continue;
    throw Error::bad_input("a frame of the script has no picture", "frames in memory",
                           "Add JPEG bytes or raw pixels");
  }
  if (frames.empty()) {
    throw Error::bad_input("the script has no frames", "frames in memory", "Add at least one");
  }
}

}  // namespace

std::unique_ptr<ingest::FrameSource> make_scripted_source(SourceScript script) {
  check(script.frames);
  for (const SourceScript::Event& event : script.events) {
    if (const auto* change = std::get_if<SourceScript::Change>(&event.what)) check(change->frames);
  }
  if (!(script.fps >= 0 && script.fps <= 1e6)) {
    throw Error::bad_input(
        fmt::format("the rate is {} frames per second, allowed: 0 to 1000000", script.fps),
        "frames in memory", "Correct the rate");
  }
  return std::make_unique<MemorySource>(std::move(script));
}

}  // namespace raystage::testing
