// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "base/error.h"
#include "schemas/event_document.h"

namespace raystage::cli {

/// Set to 0, this environment variable keeps commands from writing event logs.
inline constexpr const char* kEventLogVariable = "RAYSTAGE_EVENT_LOG";

/// Appends what a command did to a take, or found in it, to the take's event log
/// (docs/formats/events.md), as the last thing that the command does. Never throws: a take that
/// cannot be written to gets no event, and other faults are a warning on stderr.
/// `type`: of PREMIS' vocabulary, e.g. "fixity check"; `detail`: the command and what it was asked
/// for; `note`: the result. Returns the event, or nullopt if there is none.
std::optional<schemas::TakeEvent> record_event(
    const std::filesystem::path& take, const std::string& type, const std::string& detail,
    const std::string& note = "",
    schemas::TakeEvent::Outcome outcome = schemas::TakeEvent::Outcome::kSuccess);

/// Returns success for kSuccess, failure for kFailed and kBadInput, and a warning for codes of what
/// was done in part.
schemas::TakeEvent::Outcome outcome_of(ExitCode code);

/// Appends an event to the log of the take whose rig.json this file is; does nothing if it is no
/// take's.
void record_rig_event(const std::filesystem::path& rig_file, const std::string& detail);

/// Appends an event that was made before, such as that of another copy of the take.
void record_made_event(const std::filesystem::path& take, const schemas::TakeEvent& event);

}  // namespace raystage::cli
