// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"

namespace raystage {
struct ContainedPath;
}

namespace raystage::schemas {

/// Schema "raystage/recording/1" (TAKE/recording/NODE.json): how a node recorded its cameras.
struct RecordingDocument {
  struct Event {
    Nanoseconds time_utc = 0;  ///< since 1970
    std::string what;
  };
  /// The frames of one camera in a session.
  struct Camera {
    std::string id;
    std::string source;  ///< description for the user
    std::string clock = "host", timestamp_event = "unknown";
    std::uint64_t arrived = 0, stored = 0;
    std::map<std::string, std::uint64_t> dropped;  ///< count by reason; only reasons that occurred
    std::uint64_t skipped_by_source = 0, corrected_timestamps = 0;
    std::vector<Event> events;
  };
  /// The synchronisation of the node's clock.
  struct Clock {
    std::string source = "unknown";     ///< "chrony", "ptp", "kernel", "unknown"
    std::optional<double> offset_s;     ///< clock minus reference, seconds
    std::optional<double> max_error_s;  ///< seconds
  };
  struct AuditResult {
    bool holds = false;
    std::vector<std::string> problems;
  };
  /// A folder that the session was written to, if there was a mirror.
  struct Copy {
    std::string folder;
    bool complete = false;  ///< whether it has every record of the session
    std::string problem;    ///< why it was stopped; empty if it was not
  };
  /// One run of `raystage record`.
  struct Session {
    std::string program;
    Nanoseconds started_utc = 0;
    std::optional<Nanoseconds> start_at_utc;  ///< requested start; absent: at once
    std::optional<Nanoseconds> stopped_utc;   ///< absent: running, or killed
    std::string stop_reason;
    std::uint64_t memory_bytes = 0, memory_peak_bytes = 0;
    std::optional<std::uint64_t> memory_ceiling_bytes;  ///< of the whole process; absent: none
    std::optional<std::uint64_t> process_peak_bytes;    ///< resident, with libraries
    bool held = false;  ///< whether frames stayed in memory until the end
    Clock clock;
    std::vector<Camera> cameras;
    std::optional<AuditResult> audit;  ///< with stopped_utc
    std::vector<Copy> copies;          ///< with stopped_utc: the take and its mirror; empty: none

    /// Returns the delay after start_at_utc, or 0. Frames of that time are missing on this node,
    /// but other nodes may have them.
    Nanoseconds late() const {
      if (!start_at_utc || started_utc <= *start_at_utc) return 0;
      Nanoseconds delay = 0;
      return __builtin_sub_overflow(started_utc, *start_at_utc, &delay)
                 ? std::numeric_limits<Nanoseconds>::max()
                 : delay;
    }
  };
  std::string node;
  std::vector<Session> sessions;
};

RecordingDocument read_recording(const std::filesystem::path& file);
RecordingDocument read_recording(const ContainedPath& file);
void write_recording(const RecordingDocument& recording, const std::filesystem::path& file);

/// Parses and formats the document in memory; errors use `name` as the file name.
RecordingDocument parse_recording(std::string_view text, std::string_view name);
std::string format_recording(const RecordingDocument& recording);

}  // namespace raystage::schemas
