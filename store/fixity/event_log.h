// SPDX-License-Identifier: Apache-2.0
// The event log of a take (docs/formats/events.md): a line of JSON for each command that changed or
// checked the take.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "schemas/event_document.h"

namespace raystage::store {

/// Name of the event log in a take's folder. Manifests do not list it, because it grows.
inline constexpr const char* kEventLogFile = "events.jsonl";

/// Returns the digest that identifies a take's contents: the SHA-256 of the lines of sha256sum for
/// take.json, rig.json and all journals, sorted by path. Journals hold the XXH3 of each frame.
/// Throws Error (bad input) if one of them cannot be read.
std::string take_digest(const std::filesystem::path& take);

/// Returns an event of now, with a new id, and with name, epoch and digest of the take.
schemas::TakeEvent make_event(const std::filesystem::path& take, schemas::TakeEvent event);

/// Appends an event to the log of a take: one write, flushed to disk, under a lock. A line that an
/// earlier write left incomplete stays, on its own. Returns false if the take cannot be written to
/// (permissions, or a file system that is read only), or is the payload of a bag. Throws Error
/// (failed) if the disk fails or is full, and the log is then as it was; Error (bad input) if the
/// log is behind a link, is no regular file or would grow beyond kMaxEventLogBytes.
bool append_event(const std::filesystem::path& take, const schemas::TakeEvent& event);
inline constexpr std::uint64_t kMaxEventLogBytes = std::uint64_t{64} << 20;

struct EventLog {
  std::vector<schemas::TakeEvent> events;  ///< in the order of the file
  std::uint64_t damaged_lines = 0;         ///< that are no events
};
/// Returns the events in the bytes of a log. Accepts any bytes.
EventLog parse_event_log(std::string_view text, std::string_view name);
/// Returns the events of a take; none if there is no log. Throws Error (bad input) if it cannot be
/// read.
EventLog read_event_log(const std::filesystem::path& take);

}  // namespace raystage::store
