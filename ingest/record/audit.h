// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "ingest/record/archive_writer_thread.h"
#include "ingest/record/camera_capture.h"
#include "ingest/record/recording_take.h"

namespace raystage {

/// Draws up the account at the end of a session: what the sources delivered (counted as it came in)
/// against what stands in the archives (opened anew and counted). Fills the session's cameras and
/// its audit, which holds only if every frame seen is stored or recorded as dropped.
void audit_session(const RecordingTake& take, const ArchiveWriterThread& flow,
                   std::span<const CameraCounters> counters, RecordingDocument::Session& session,
                   std::vector<std::string> problems);

}  // namespace raystage
