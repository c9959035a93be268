// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/simulated_source.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "ingest/sources/configuration_error.h"
#include "ingest/sources/interruptible_wait.h"
#include "ingest/sources/shared_simulation.h"

namespace raystage::ingest {
namespace {

constexpr std::uint64_t kDeviceBuffers = 8;  // frames

class SimulatedSource final : public FrameSource {
 public:
  explicit SimulatedSource(const schemas::RecordConfig::SimulatedSource& source)
      : simulation_(SharedSimulation::shared(source)), loop_(simulation_->loop(source.index)) {
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
    // A late reader finds the latest frames in the device's buffers.
    const std::uint64_t coming = first_after(now);
    if (coming > next_ + kDeviceBuffers) next_ = coming - kDeviceBuffers;
    const Clock::time_point due = time_of(next_);
    if (due > now && (!wait_.until(std::min(due, deadline)) || due > deadline)) {
      return Outcome::kNoData;
    }
    const SimulatedLoop::Exposure& shown = exposure(next_);
    frame.jpeg = shown.jpeg;
    frame.raw = shown.raw;
    // Frames that waited, for example while other cameras were opened, arrived in the past.
    frame.arrival_steady = host_steady_now() - std::chrono::nanoseconds(Clock::now() - due).count();
    frame.device_time = loops_before(next_) + shown.stamped_time;
    frame.sequence = next_;
    frame.torn = false;
    ++next_;
    return Outcome::kFrame;
  }

  void interrupt() override { wait_.interrupt(); }
  /// Counts the rendered frames and an equal part of the memory that the cameras share.
  std::size_t memory_overhead() const override {
    std::size_t bytes = simulation_->memory() / static_cast<std::size_t>(simulation_.use_count());
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
  /// Returns the duration of the complete loops before an exposure.
  Nanoseconds loops_before(std::uint64_t number) const {
    return static_cast<Nanoseconds>(number / loop_->exposures.size()) * loop_->length;
  }
  Clock::time_point time_of(std::uint64_t number) const {
    return simulation_->start() +
           std::chrono::nanoseconds(loops_before(number) + exposure(number).true_time);
  }
  std::uint64_t first_after(Clock::time_point time) const {
    const Nanoseconds passed = std::chrono::nanoseconds(time - simulation_->start()).count();
    // Phase and jitter can only delay a loop's first exposures.
    const auto loops = static_cast<std::uint64_t>(passed / loop_->length);
    std::uint64_t number = loops * loop_->exposures.size();
    if (number > 0) --number;
    number = std::max(number, next_);  // earlier ones are past
    while (time_of(number) <= time) ++number;
    return number;
  }

  std::shared_ptr<SharedSimulation> simulation_;
  std::shared_ptr<const SimulatedLoop> loop_;
  SourceDescription description_;
  InterruptibleWait wait_;
  std::uint64_t next_ = 0;
};

}  // namespace

std::unique_ptr<FrameSource> open_simulated_source(
    const schemas::RecordConfig::SimulatedSource& source) {
  if (source.index < 0 || source.index >= source.rows * source.columns) {
    throw ConfigurationError(
        Error::bad_input(fmt::format("index {} is not in an array of {}x{} cameras", source.index,
                                     source.rows, source.columns),
                         "simulated", "Set an index from 0 to rows * columns - 1"));
  }
  return std::make_unique<SimulatedSource>(source);
}

}  // namespace raystage::ingest
