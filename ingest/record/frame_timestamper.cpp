// SPDX-License-Identifier: Apache-2.0
// Computes the time stamp of each frame: the device's clock with the offset of its first frame, or
// the arrival time. Times in ns since the take's epoch, strictly increasing. Gaps in the device's
// counter give the number of skipped frames. Devices are not trusted: what the host's clock rules
// out is a step of the device's clock or a jump of its counter.
#include "ingest/record/frame_timestamper.h"

#include <algorithm>
#include <cstdlib>

namespace raystage::ingest {
namespace {

/// A device's clock that deviates more from the host's has stepped. Free crystals drift by less
/// than 10 s a day. Cameras that count nominal frame periods may be wrong by 1 %, for which 1/50 of
/// the elapsed time is allowed in addition.
constexpr Nanoseconds kMaxDeviation = 60 * kNanosecondsPerSecond, kRateTolerance = 50;
/// Times that are ahead stay ahead after a step, because they increase. Steps add up to this.
constexpr Nanoseconds kMaxLead = 24 * 3600 * kNanosecondsPerSecond;

/// A larger jump of the counter is taken as a reset, not as dropped frames.
constexpr std::uint64_t kLargestGap = 1'000'000;
/// A device drops at most the frames of the time that has passed. Twice its nominal rate is allowed
/// for cameras that are triggered, and the frames of a stall of the host, which shows in arrivals
/// before and after the gap.
constexpr double kMostFps = 5000, kRateMargin = 2, kLongestStallS = 2, kSpareFrames = 16;

}  // namespace

FrameTimestamper::Stamp FrameTimestamper::stamp(const SourceFrame& frame, Nanoseconds arrival_utc) {
  Stamp stamp;
  stamp.arrival_ns = arrival_utc - epoch_utc_;
  std::optional<Nanoseconds> by_device;
  if (frame.device_time) by_device = time_by_device(*frame.device_time, stamp.arrival_ns);
  stamp.time_ns = by_device.value_or(stamp.arrival_ns);
  stamp.clock_stepped = frame.device_time && clock_reference_ && !by_device;
  stamp.corrected = stamp.clock_stepped || stamp.time_ns <= last_time_;
  stamp.time_ns = std::max(stamp.time_ns, last_time_ + 1);
  if (frame.device_time && !by_device) {
    clock_reference_ = {*frame.device_time, stamp.arrival_ns, stamp.time_ns};
  }
  stamp.sequence = frame.sequence.value_or(arrivals_);
  ++arrivals_;
  measure_rate(stamp.arrival_ns);
  if (frame.sequence) count_skipped(*frame.sequence, stamp);
  // Each missing frame in between needs its own nanosecond.
  const auto room = static_cast<std::uint64_t>(stamp.time_ns - last_time_ - 1);
  if (stamp.skipped > room) stamp.skipped = room;
  last_time_ = stamp.time_ns;
  return stamp;
}

/// Returns the time by the device's clock; nullopt without a reference, or if the clock has
/// stepped.
std::optional<Nanoseconds> FrameTimestamper::time_by_device(Nanoseconds device_time,
                                                            Nanoseconds arrival_ns) const {
  if (!clock_reference_) return std::nullopt;
  Nanoseconds elapsed = 0, time = 0;
  if (__builtin_sub_overflow(device_time, clock_reference_->device_time, &elapsed) ||
      __builtin_add_overflow(clock_reference_->time_ns, elapsed, &time)) {
    return std::nullopt;
  }
  if (!is_live_) return time <= kMaxArchiveTime ? std::optional(time) : std::nullopt;
  const Nanoseconds elapsed_here = arrival_ns - clock_reference_->arrival_ns;
  const Nanoseconds tolerance = kMaxDeviation + std::abs(elapsed_here) / kRateTolerance;
  const bool is_plausible = elapsed >= elapsed_here - tolerance &&
                            elapsed <= elapsed_here + tolerance && time <= arrival_ns + kMaxLead;
  return is_plausible ? std::optional(time) : std::nullopt;
}

/// Keeps the highest rate of arrivals over a second: cameras that are triggered may state another
/// one than that of their trigger.
void FrameTimestamper::measure_rate(Nanoseconds arrival_ns) {
  const Nanoseconds elapsed = arrival_ns - rate_interval_.begin_ns;
  if (rate_interval_.frames > 0 && elapsed >= kNanosecondsPerSecond) {
    const double rate =
        static_cast<double>(rate_interval_.frames) * kNsPerS / static_cast<double>(elapsed);
    fps_ = std::max(fps_, std::min(rate, kMostFps));
  }
  if (rate_interval_.frames == 0 || elapsed < 0 || elapsed >= kNanosecondsPerSecond) {
    rate_interval_ = {arrival_ns, 0};
  }
  ++rate_interval_.frames;
}

void FrameTimestamper::count_skipped(std::uint64_t sequence, Stamp& stamp) {
  const double most_skipped_per_s = kRateMargin * fps_;
  const double most_credit = most_skipped_per_s * kLongestStallS + kSpareFrames;
  if (!counter_) {
    counter_ = {sequence, stamp.arrival_ns, most_credit};
    return;
  }
  const double waited_s =
      static_cast<double>(std::max<Nanoseconds>(0, stamp.arrival_ns - counter_->arrival_ns)) /
      kNsPerS;
  const double credit = counter_->credit + most_skipped_per_s * waited_s;
  const std::uint64_t gap = sequence - counter_->sequence - 1;  // large if the counter went back
  if (gap <= kLargestGap && static_cast<double>(gap) <= credit) {
    stamp.skipped = gap;
  } else {
    stamp.counter_jumped = true;
  }
  counter_ = {sequence, stamp.arrival_ns,
              std::min(most_credit, credit - static_cast<double>(stamp.skipped))};
}

Nanoseconds FrameTimestamper::interpolate_time(Nanoseconds last, Nanoseconds next,
                                               std::uint64_t index, std::uint64_t count) {
  const Nanoseconds span = next - last;
  const auto parts = static_cast<Nanoseconds>(count + 1);
  const auto part = static_cast<Nanoseconds>(index + 1);
  // This order does not overflow for a gap of hours with a million frames.
  return last + span / parts * part + span % parts * part / parts;
}

void FrameTimestamper::reset_device(const SourceDescription& source) {
  clock_reference_.reset();
  counter_.reset();
  is_live_ = source.live;
  // What a device states is not trusted either.
  const bool is_plausible = source.fps > 0 && source.fps < kMostFps;
  fps_ = is_plausible ? source.fps : kMostFps;
  rate_interval_ = {};
}

}  // namespace raystage::ingest
