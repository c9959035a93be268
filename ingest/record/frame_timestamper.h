// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/time.h"
#include "ingest/sources/frame_source.h"

namespace raystage::ingest {

/// Converts the times and counters of one camera's source to the archive's: strictly increasing
/// times in ns since the take's epoch.
class FrameTimestamper {
 public:
  explicit FrameTimestamper(Nanoseconds epoch_utc, Nanoseconds last_time = -1)
      : epoch_utc_(epoch_utc), last_time_(last_time) {
    reset_device({});
  }

  struct Stamp {
    Nanoseconds time_ns = 0;     ///< by the device's clock if it has one, else arrival
    Nanoseconds arrival_ns = 0;  ///< by the host's clock
    std::uint64_t sequence = 0;  ///< the device's counter, or arrivals counted from 0
    std::uint64_t skipped = 0;   ///< frames missing before this one, according to the counter
    /// The time did not increase and was set to the last one + 1 ns, or the device's clock stepped.
    bool corrected = false;
    bool clock_stepped = false;   ///< the device's, by more than a minute: its offset is a new one
    bool counter_jumped = false;  ///< the device's, by more frames than it can have dropped
  };
  /// Returns the times and counters of the next frame. The first frame determines the offset of the
  /// device's clock. Its drift and smaller steps are not corrected, so that resynchronisation can
  /// measure them.
  /// `arrival_utc`: that of the frame by HostClock, in ns since 1970.
  Stamp stamp(const SourceFrame& frame, Nanoseconds arrival_utc);

  /// Returns the time of missing frame `index` of `count`, evenly spaced between `last` and `next`.
  static Nanoseconds interpolate_time(Nanoseconds last, Nanoseconds next, std::uint64_t index,
                                      std::uint64_t count);
  Nanoseconds last_time() const { return last_time_; }
  /// Forgets the device's clock and counter, which start anew. Must be called after a reconnection.
  /// `source`: its rate, or that at which its frames arrive if that is higher, limits the frames
  /// that it can have dropped. If it is not live, its times pass as fast as it is read.
  void reset_device(const SourceDescription& source);

 private:
  /// A frame from which the device's clock is counted.
  struct ClockReference {
    Nanoseconds device_time = 0, arrival_ns = 0, time_ns = 0;
  };
  struct Counter {
    std::uint64_t sequence = 0;  ///< of the last frame
    Nanoseconds arrival_ns = 0;  ///< likewise
    double credit = 0;           ///< frames that may have been dropped without a pause
  };
  std::optional<Nanoseconds> time_by_device(Nanoseconds device_time, Nanoseconds arrival_ns) const;
  void measure_rate(Nanoseconds arrival_ns);
  void count_skipped(std::uint64_t sequence, Stamp& stamp);

  Nanoseconds epoch_utc_, last_time_;
  std::optional<ClockReference> clock_reference_;
  bool is_live_ = true;
  double fps_ = 0;  ///< nominal, or the highest at which frames arrived
  struct {
    Nanoseconds begin_ns = 0;
    std::uint64_t frames = 0;
  } rate_interval_;
  std::optional<Counter> counter_;
  std::uint64_t arrivals_ = 0;
};

}  // namespace raystage::ingest
