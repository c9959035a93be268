// SPDX-License-Identifier: Apache-2.0
// Computes the time stamp of each frame: the device's clock with the offset of its first frame, or
// the arrival time. Times in ns since the take's epoch, strictly increasing. Gaps in the device's
// counter give the number of skipped frames.
#include "ingest/record/frame_timestamper.h"

namespace raystage::ingest {
namespace {

/// A larger jump of the counter is taken as a reset, not as dropped frames.
constexpr std::uint64_t kLargestGap = 1'000'000;

}  // namespace

FrameTimestamper::Stamp FrameTimestamper::stamp(const SourceFrame& frame) {
  Stamp stamp;
  stamp.arrival_ns = frame.arrival_utc - epoch_utc_;
  stamp.time_ns = stamp.arrival_ns;
  if (frame.device_time) {
    if (!device_clock_offset_) device_clock_offset_ = stamp.arrival_ns - *frame.device_time;
    stamp.time_ns = *frame.device_time + *device_clock_offset_;
  }
  if (stamp.time_ns <= last_time_) {
    stamp.time_ns = last_time_ + 1;
    stamp.corrected = true;
  }
  stamp.sequence = frame.sequence.value_or(arrivals_);
  ++arrivals_;
  if (frame.sequence && last_sequence_ && *frame.sequence > *last_sequence_) {
    const std::uint64_t gap = *frame.sequence - *last_sequence_ - 1;
    if (gap <= kLargestGap) stamp.skipped = gap;
  }
  if (frame.sequence) last_sequence_ = frame.sequence;
  // Each missing frame in between needs its own nanosecond.
  const auto room = static_cast<std::uint64_t>(stamp.time_ns - last_time_ - 1);
  if (stamp.skipped > room) stamp.skipped = room;
  last_time_ = stamp.time_ns;
  return stamp;
}

Nanoseconds FrameTimestamper::interpolate_time(Nanoseconds last, Nanoseconds next,
                                               std::uint64_t index, std::uint64_t count) {
  const Nanoseconds span = next - last;
  const auto parts = static_cast<Nanoseconds>(count + 1);
  const auto part = static_cast<Nanoseconds>(index + 1);
  // This order does not overflow for a gap of hours with a million frames.
  return last + span / parts * part + span % parts * part / parts;
}

void FrameTimestamper::reset_device_clock() {
  device_clock_offset_.reset();
  last_sequence_.reset();
}

}  // namespace raystage::ingest
