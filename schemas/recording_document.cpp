// SPDX-License-Identifier: Apache-2.0
#include "schemas/recording_document.h"

#include "base/contained_path.h"
#include "schemas/fields.h"

namespace raystage::schemas {
namespace {

using RecordedCamera = RecordingDocument::Camera;
using RecordedClock = RecordingDocument::Clock;
using Audit = RecordingDocument::AuditResult;
using Copy = RecordingDocument::Copy;
using Event = RecordingDocument::Event;
using Session = RecordingDocument::Session;

constexpr Fields kEvent(required("time_utc", &Event::time_utc, kUtc),
                        required("what", &Event::what));

constexpr Fields kRecordedCamera(
    required("id", &RecordedCamera::id), required("source", &RecordedCamera::source),
    required("clock", &RecordedCamera::clock),
    required("timestamp_event", &RecordedCamera::timestamp_event),
    defaulted("arrived", &RecordedCamera::arrived), defaulted("stored", &RecordedCamera::stored),
    defaulted("dropped", &RecordedCamera::dropped),
    defaulted("skipped_by_source", &RecordedCamera::skipped_by_source),
    defaulted("corrected_timestamps", &RecordedCamera::corrected_timestamps),
    defaulted("events", &RecordedCamera::events, list_of(kEvent)));

constexpr Fields kClock(required("source", &RecordedClock::source),
                        optional("offset_s", &RecordedClock::offset_s),
                        optional("max_error_s", &RecordedClock::max_error_s));

constexpr Fields kAudit(required("passed", &Audit::holds), required("problems", &Audit::problems));

constexpr Fields kCopy(required("folder", &Copy::folder), required("complete", &Copy::complete),
                       optional("problem", &Copy::problem));

constexpr Fields kSession(required("program", &Session::program),
                          required("started_utc", &Session::started_utc, kUtc),
                          optional("start_at_utc", &Session::start_at_utc, kUtc),
                          optional("stopped_utc", &Session::stopped_utc, kUtc),
                          optional("stop_reason", &Session::stop_reason),
                          required("memory_bytes", &Session::memory_bytes),
                          defaulted("memory_peak_bytes", &Session::memory_peak_bytes),
                          optional("memory_ceiling_bytes", &Session::memory_ceiling_bytes),
                          optional("process_peak_bytes", &Session::process_peak_bytes),
                          required("buffered_in_memory", &Session::held),
                          required("clock", &Session::clock, kClock),
                          required("cameras", &Session::cameras, list_with_ids(kRecordedCamera)),
                          optional("audit", &Session::audit, kAudit),
                          defaulted("copies", &Session::copies, list_of(kCopy)));

constexpr Fields kRecording(required("node", &RecordingDocument::node),
                            required("sessions", &RecordingDocument::sessions, list_of(kSession)));

}  // namespace

RecordingDocument parse_recording(std::string_view text, std::string_view name) {
  return parse_document_as<RecordingDocument>("recording", kRecording, text, name);
}

std::string format_recording(const RecordingDocument& recording) {
  return format_document("recording", kRecording, recording);
}

RecordingDocument read_recording(const std::filesystem::path& file) {
  return parse_recording(read_file(file), file.string());
}

RecordingDocument read_recording(const ContainedPath& file) {
  return parse_recording(read_file(file), file.path().string());
}

void write_recording(const RecordingDocument& recording, const std::filesystem::path& file) {
  write_document(format_recording(recording), parse_recording, file);
}

}  // namespace raystage::schemas
