// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/time.h"
#include "ingest/sources/frame_source.h"

namespace raystage {

/// One camera's times and counters, from what its source says to what the archive holds: since the
/// take's epoch, strictly increasing.
class FrameTimestamper {
 public:
  explicit FrameTimestamper(Nanoseconds epoch_utc, Nanoseconds last_time = -1)
      : epoch_utc_(epoch_utc), last_time_(last_time) {}

  struct Stamp {
    Nanoseconds time_ns = 0;     ///< by the device's clock where it has one, else arrival
    Nanoseconds arrival_ns = 0;  ///< by the host's clock
    std::uint64_t sequence = 0;  ///< the device's counter, or arrivals counted from 0
    std::uint64_t skipped = 0;   ///< frames that the counter says are missing before this one
    bool corrected = false;      ///< the time did not increase and was set behind the last one
  };
  /// The device's clock is taken over with the offset that its first frame shows: its rate and its
  /// steps stay as they are, for the resynchronizer to see.
  Stamp stamp(const SourceFrame& frame);

  /// Times for `count` frames that are missing between the last stamp and `next`.
  static Nanoseconds interpolate_time(Nanoseconds last, Nanoseconds next, std::uint64_t index,
                                      std::uint64_t count);
  Nanoseconds last_time() const { return last_time_; }
  /// After a reconnection the device's clock and counter start anew.
  void reset_device_clock();

 private:
  Nanoseconds epoch_utc_, last_time_;
  std::optional<Nanoseconds> device_clock_offset_;
  std::optional<std::uint64_t> last_sequence_;
  std::uint64_t arrivals_ = 0;
};

}  // namespace raystage
