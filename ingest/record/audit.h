// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "ingest/record/archive_writer_thread.h"
#include "ingest/record/camera_capture.h"
#include "ingest/record/recording_take.h"

namespace raystage::ingest {

/// Compares the frames that the sources delivered (counted on arrival) with the records in the
/// archives (opened again and counted). Fills the cameras and the audit of the session. The audit
/// passes only if every delivered frame is stored or recorded as dropped.
void audit_session(const RecordingTake& take, const ArchiveWriterThread& writer,
                   std::span<const CameraCounters> counters,
                   schemas::RecordingDocument::Session& session, std::vector<std::string> problems);

}  // namespace raystage::ingest
