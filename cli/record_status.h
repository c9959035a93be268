// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "ingest/record/recorder.h"
#include "schemas/recording_document.h"

namespace raystage::cli {

/// Returns one line of text: rates, drops, memory, disk, time left. Few cameras are listed each; of
/// many, those that are slow or drop frames.
std::string status_line(const ingest::RecorderStatus& status);
/// Returns one line of JSON with all values.
std::string status_json(const ingest::RecorderStatus& status);
/// Returns the summary at the end as text.
std::string format_session_summary(const schemas::RecordingDocument::Session& session);
/// Returns a duration as "2 h 05 min", "3 min 20 s" or "12 s".
std::string format_duration(double seconds);

}  // namespace raystage::cli
