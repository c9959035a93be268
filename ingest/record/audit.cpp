// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/audit.h"

#include <fmt/format.h>

#include "base/error.h"

namespace raystage::ingest {

void audit_session(const RecordingTake& take, const ArchiveWriterThread& writer,
                   std::span<const CameraCounters> counters,
                   schemas::RecordingDocument::Session& session,
                   std::vector<std::string> problems) {
  for (std::size_t i = 0; i < session.cameras.size(); ++i) {
    schemas::RecordingDocument::Camera& camera = session.cameras[i];
    const auto add_problem = [&](const std::string& problem) {
      problems.push_back(fmt::format("camera {}: {}", camera.id, problem));
    };
    camera.arrived = counters[i].arrived;
    camera.skipped_by_source = counters[i].skipped_by_source;
    camera.corrected_timestamps = counters[i].corrected_timestamps;
    for (const RecordingEvent& event : counters[i].events()) {
      camera.events.push_back({event.time_utc, event.what});
    }
    RecordingTake::RecordCounts on_disk;
    try {
      on_disk = take.count(i);
    } catch (const Error& error) {
      add_problem(error.what());
    }
    std::uint64_t accounted = 0;
    for (std::size_t s = 0; s < store::kFrameStatusCount; ++s) {
      const auto status = static_cast<store::FrameStatus>(s);
      const std::uint64_t count = on_disk.by_status[s];
      if (count != writer.written(i, status)) {
        add_problem(fmt::format("{} records \"{}\" were written, {} are on disk",
                                writer.written(i, status), store::name_of(status), count));
      }
      if (status == store::FrameStatus::kDroppedBySource) continue;
      accounted += count;
      if (status == store::FrameStatus::kStored) {
        camera.stored = count;
      } else if (count > 0) {
        camera.dropped[store::name_of(status)] = count;
      }
    }
    if (accounted != camera.arrived) {
      add_problem(fmt::format("{} frames arrived, {} are stored or recorded as dropped",
                              camera.arrived, accounted));
    }
    const auto skipped =
        on_disk.by_status[static_cast<std::size_t>(store::FrameStatus::kDroppedBySource)];
    if (skipped != camera.skipped_by_source) {
      add_problem(fmt::format("the source's counter skipped {} frames, {} are recorded",
                              camera.skipped_by_source, skipped));
    }
  }
  session.audit = schemas::RecordingDocument::AuditResult{problems.empty(), std::move(problems)};
}

}  // namespace raystage::ingest
