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
      : epoch_utc_(epoch_utc), last_time_(last_time) {}

  struct Stamp {
    Nanoseconds time_ns = 0;     ///< by the device's clock if it has one, else arrival
    Nanoseconds arrival_ns = 0;  ///< by the host's clock
    std::uint64_t sequence = 0;  ///< the device's counter, or arrivals counted from 0
    std::uint64_t skipped = 0;   ///< frames missing before this one, according to the counter
    bool corrected = false;      ///< the time did not increase: it was set to the last one + 1 ns
  };
  /// Returns the times and counters of the next frame. The first frame determines the offset of the
  /// device's clock. Its drift and steps are not corrected, so that resynchronisation can measure
  /// them.
  Stamp stamp(const SourceFrame& frame);

  /// Returns the time of missing frame `index` of `count`, evenly spaced between `last` and `next`.
  static Nanoseconds interpolate_time(Nanoseconds last, Nanoseconds next, std::uint64_t index,
                                      std::uint64_t count);
  Nanoseconds last_time() const { return last_time_; }
  /// Forgets the device's clock and counter, which start anew. Must be called after a reconnection.
  void reset_device_clock();

 private:
  Nanoseconds epoch_utc_, last_time_;
  std::optional<Nanoseconds> device_clock_offset_;
  std::optional<std::uint64_t> last_sequence_;
  std::uint64_t arrivals_ = 0;
};

}  // namespace raystage::ingest
