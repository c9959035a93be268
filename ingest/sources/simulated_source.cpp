// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/simulated_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "ingest/sources/interruptible_wait.h"
#include "ingest/sources/shared_simulation.h"

namespace raystage {
namespace {

constexpr std::uint64_t kDeviceBuffers = 8;

class SimulatedSource final : public FrameSource {
 public:
  explicit SimulatedSource(const RecordConfig::SimulatedSource& source)
      : stage_(SharedSimulation::shared(source)), loop_(stage_->loop(source.index)) {
    description_ = {.what = fmt::format("simulated {}, camera {} of {}x{}", source.scene,
                                        source.index, source.rows, source.columns),
                    .width = source.width,
                    .height = source.height,
                    .fps = source.fps,
                    .delivers_jpeg = source.jpeg,
                    .clock = "simulated",
                    .timestamp_event = "exposure_middle"};
    next_ = first_after(Clock::now());
  }

  const SourceDescription& description() const override { return description_; }

  Outcome next(SourceFrame& frame, std::chrono::milliseconds patience) override {
    const Clock::time_point now = Clock::now(), deadline = now + patience;
    // A late reader finds the device's buffers full of the latest.
    const std::uint64_t coming = first_after(now);
    if (coming > next_ + kDeviceBuffers) next_ = coming - kDeviceBuffers;
    const Clock::time_point due = time_of(next_);
    if (due > now && (!wait_.until(std::min(due, deadline)) || due > deadline)) {
      return Outcome::kNoData;
    }
    const SimulatedLoop::Exposure& shown = exposure(next_);
    frame.jpeg = shown.jpeg;
    frame.raw = shown.raw;
    // When it came, not when it is read: what waited while other cameras were opened is of the
    // past.
    frame.arrival_utc = host_utc_now() - std::chrono::nanoseconds(Clock::now() - due).count();
    frame.device_time = loops_before(next_) + shown.stamped_time;
    frame.sequence = next_;
    frame.torn = false;
    ++next_;
    return Outcome::kFrame;
  }

  void interrupt() override { wait_.interrupt(); }
  /// The pictures that were rendered beforehand, and a part of what the array's cameras share.
  std::size_t memory_overhead() const override {
    std::size_t bytes = stage_->memory() / static_cast<std::size_t>(stage_.use_count());
    for (const SimulatedLoop::Exposure& shown : loop_->exposures) {
      bytes += shown.jpeg.capacity() + shown.raw.bytes_in_memory();
    }
    return bytes;
  }

 private:
  using Clock = SharedSimulation::Clock;

  const SimulatedLoop::Exposure& exposure(std::uint64_t number) const {
    return loop_->exposures[number % loop_->exposures.size()];
  }
  /// Length of the whole loops before an exposure.
  Nanoseconds loops_before(std::uint64_t number) const {
    return static_cast<Nanoseconds>(number / loop_->exposures.size()) * loop_->length;
  }
  Clock::time_point time_of(std::uint64_t number) const {
    return stage_->start() +
           std::chrono::nanoseconds(loops_before(number) + exposure(number).true_time);
  }
  /// The first exposure later than `time`.
  std::uint64_t first_after(Clock::time_point time) const {
    const Nanoseconds passed = std::chrono::nanoseconds(time - stage_->start()).count();
    // Phase and jitter may carry a loop's first exposures behind its nominal start, never before
    // it.
    const auto loops = static_cast<std::uint64_t>(passed / loop_->length);
    std::uint64_t number = loops * loop_->exposures.size();
    if (number > 0) --number;
    number = std::max(number, next_);  // those before are past
    while (time_of(number) <= time) ++number;
    return number;
  }

  std::shared_ptr<SharedSimulation> stage_;
  std::shared_ptr<const SimulatedLoop> loop_;
  SourceDescription description_;
  InterruptibleWait wait_;
  std::uint64_t next_ = 0;
};

}  // namespace

std::unique_ptr<FrameSource> open_simulated_source(const RecordConfig::SimulatedSource& source) {
  if (source.index < 0 || source.index >= source.rows * source.columns) {
    throw Error::bad_input(fmt::format("camera {} is not in an array of {}x{}", source.index,
                                       source.rows, source.columns),
                           "simulated", "Give an index below rows times columns");
  }
  return std::make_unique<SimulatedSource>(source);
}

}  // namespace raystage
