// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"

namespace raystage {

/// schema "raystage/recording/1" (TAKE/recording/NODE.json): how a node recorded its cameras.
struct RecordingDocument {
  struct Event {
    Nanoseconds time_utc = 0;  ///< since 1970
    std::string what;
  };
  /// What one camera's frames became in a session.
  struct Camera {
    std::string id;
    std::string source;  ///< for people
    std::string clock = "host", timestamp_event = "unknown";
    std::uint64_t arrived = 0, stored = 0;
    std::map<std::string, std::uint64_t> dropped;  ///< by reason; only those that happened
    std::uint64_t skipped_by_source = 0, corrected_timestamps = 0;
    std::vector<Event> events;
  };
  /// What disciplined the node's clock.
  struct Clock {
    std::string source = "unknown";     ///< "chrony", "ptp", "kernel", "unknown"
    std::optional<double> offset_s;     ///< clock minus reference, seconds
    std::optional<double> max_error_s;  ///< seconds
  };
  struct AuditResult {
    bool holds = false;
    std::vector<std::string> problems;
  };
  /// One run of `raystage record`.
  struct Session {
    std::string program;
    Nanoseconds started_utc = 0;
    std::optional<Nanoseconds>
        start_at_utc;                        ///< frames were to count from then on; absent: at once
    std::optional<Nanoseconds> stopped_utc;  ///< absent: runs, or was killed
    std::string stop_reason;
    std::uint64_t memory_bytes = 0, memory_peak_bytes = 0;
    bool held = false;
    Clock clock;
    std::vector<Camera> cameras;
    std::optional<AuditResult> audit;  ///< with stopped_utc

    /// By how much it came too late for start_at_utc: frames of that time are missing, and other
    /// nodes have them. 0 where it did not.
    Nanoseconds late() const {
      return start_at_utc && started_utc > *start_at_utc ? started_utc - *start_at_utc : 0;
    }
  };
  std::string node;
  std::vector<Session> sessions;
};

RecordingDocument read_recording(const std::filesystem::path& file);
void write_recording(const RecordingDocument& recording, const std::filesystem::path& file);

/// The same in memory; `name` stands for the file in errors.
RecordingDocument parse_recording(std::string_view text, std::string_view name);
std::string format_recording(const RecordingDocument& recording);

}  // namespace raystage
