// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "ingest/record/recorder.h"
#include "schemas/recording_document.h"

namespace raystage {

/// One line for a person: rates, drops, memory, disk, time left. Cameras are named one by one where
/// they are few; of many, those that lag behind or drop.
std::string status_line(const RecorderStatus& status);
/// One line of JSON with everything, for programs.
std::string status_json(const RecorderStatus& status);
/// The account at the end, for a person.
std::string format_session_summary(const RecordingDocument::Session& session);
/// "2 h 05 min", "3 min 20 s", "12 s".
std::string format_duration(double seconds);

}  // namespace raystage
