// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "base/time.h"
#include "replay/live/live_status.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage::replay {

/// A take that is being recorded, seen through its archives and journals: the recorder takes no
/// notice of it. Not thread-safe.
class LiveTake {
 public:
  /// Throws Error (bad input) if the folder is not a take.
  explicit LiveTake(std::filesystem::path folder);
  ~LiveTake();

  /// Reads what was appended since the last update. `now_utc`: ns since 1970. Cost: the new records
  /// and the two documents of the take, not the length of the recording.
  void update(Nanoseconds now_utc);

  const LiveStatus& status() const;
  /// Returns the take with the latest frames only, at the last update.
  const store::Take& take() const;
  /// Returns the newest instant of which all cameras that still record have a frame; none: there is
  /// none yet.
  const std::optional<store::FrameSelection>& newest() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Returns whether a recorder is writing the take: it has a session that has not ended, and
/// something was written within the last minute.
bool is_being_recorded(const std::filesystem::path& take);

/// Gives all threads of this process the lowest priority for processors and disks, so that a
/// recorder on the same machine loses nothing. Returns whether the kernel allowed all of it.
bool lower_priority_of_process();

}  // namespace raystage::replay
