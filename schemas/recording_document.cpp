// SPDX-License-Identifier: Apache-2.0
#include "schemas/recording_document.h"

#include "base/atomic_file.h"
#include "schemas/document.h"

namespace raystage {
namespace {

using Json = nlohmann::ordered_json;
using RecordedCamera = RecordingDocument::Camera;
using Session = RecordingDocument::Session;

std::vector<RecordingDocument::Event> events_from(const JsonNode& camera) {
  std::vector<RecordingDocument::Event> events;
  if (!camera.has("events")) return events;
  const JsonNode list = camera.at("events");
  for (std::size_t i = 0; i < list.size(); ++i) {
    const JsonNode event = list.at(i);
    events.push_back({utc_from(event.at("time_utc")), event.at("what").get<std::string>()});
  }
  return events;
}

RecordedCamera camera_from_session(const JsonNode& object,
                                   std::set<std::string, std::less<>>& seen) {
  RecordedCamera camera;
  camera.id = unique_id_from(object, seen);
  camera.source = object.at("source").get<std::string>();
  camera.clock = object.at("clock").get<std::string>();
  camera.timestamp_event = object.at("timestamp_event").get<std::string>();
  camera.arrived = object.get<std::uint64_t>("arrived", 0);
  camera.stored = object.get<std::uint64_t>("stored", 0);
  if (object.has("dropped")) {
    camera.dropped = object.at("dropped").get<std::map<std::string, std::uint64_t>>();
  }
  camera.skipped_by_source = object.get<std::uint64_t>("skipped_by_source", 0);
  camera.corrected_timestamps = object.get<std::uint64_t>("corrected_timestamps", 0);
  camera.events = events_from(object);
  return camera;
}

Session session_from(const JsonNode& object) {
  Session session;
  session.program = object.at("program").get<std::string>();
  session.started_utc = utc_from(object.at("started_utc"));
  if (object.has("start_at_utc")) session.start_at_utc = utc_from(object.at("start_at_utc"));
  if (object.has("stopped_utc")) session.stopped_utc = utc_from(object.at("stopped_utc"));
  session.stop_reason = object.get<std::string>("stop_reason", "");
  session.memory_bytes = object.at("memory_bytes").get<std::uint64_t>();
  session.memory_peak_bytes = object.get<std::uint64_t>("memory_peak_bytes", 0);
  session.held = object.at("buffered_in_memory").get<bool>();
  const JsonNode clock = object.at("clock");
  session.clock.source = clock.at("source").get<std::string>();
  if (clock.has("offset_s")) session.clock.offset_s = clock.at("offset_s").get<double>();
  if (clock.has("max_error_s")) session.clock.max_error_s = clock.at("max_error_s").get<double>();
  const JsonNode cameras = object.at("cameras");
  std::set<std::string, std::less<>> seen;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    session.cameras.push_back(camera_from_session(cameras.at(i), seen));
  }
  if (object.has("audit")) {
    const JsonNode audit = object.at("audit");
    session.audit = {audit.at("passed").get<bool>(),
                     audit.at("problems").get<std::vector<std::string>>()};
  }
  return session;
}

Json json_from(const RecordedCamera& camera) {
  Json output{{"id", camera.id},
              {"source", camera.source},
              {"clock", camera.clock},
              {"timestamp_event", camera.timestamp_event},
              {"arrived", camera.arrived},
              {"stored", camera.stored},
              {"dropped", Json::object()},
              {"skipped_by_source", camera.skipped_by_source},
              {"corrected_timestamps", camera.corrected_timestamps},
              {"events", Json::array()}};
  for (const auto& [reason, count] : camera.dropped) output["dropped"][reason] = count;
  for (const RecordingDocument::Event& event : camera.events) {
    output["events"].push_back({{"time_utc", format_utc(event.time_utc)}, {"what", event.what}});
  }
  return output;
}

Json json_from(const Session& session) {
  Json output{{"program", session.program}, {"started_utc", format_utc(session.started_utc)}};
  if (session.start_at_utc) output["start_at_utc"] = format_utc(*session.start_at_utc);
  if (session.stopped_utc) output["stopped_utc"] = format_utc(*session.stopped_utc);
  if (!session.stop_reason.empty()) output["stop_reason"] = session.stop_reason;
  output["memory_bytes"] = session.memory_bytes;
  output["memory_peak_bytes"] = session.memory_peak_bytes;
  output["buffered_in_memory"] = session.held;
  output["clock"] = {{"source", session.clock.source}};
  if (session.clock.offset_s) output["clock"]["offset_s"] = *session.clock.offset_s;
  if (session.clock.max_error_s) output["clock"]["max_error_s"] = *session.clock.max_error_s;
  output["cameras"] = Json::array();
  for (const RecordedCamera& camera : session.cameras)
    output["cameras"].push_back(json_from(camera));
  if (session.audit) {
    output["audit"] = {{"passed", session.audit->holds}, {"problems", session.audit->problems}};
  }
  return output;
}

}  // namespace

RecordingDocument parse_recording(std::string_view text, std::string_view name) {
  const nlohmann::json output = parse_document("recording", text, name);
  const JsonNode document{output, name, ""};
  RecordingDocument recording;
  recording.node = document.at("node").get<std::string>();
  const JsonNode sessions = document.at("sessions");
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    recording.sessions.push_back(session_from(sessions.at(i)));
  }
  return recording;
}

std::string format_recording(const RecordingDocument& recording) {
  Json output = make_document("recording");
  output["node"] = recording.node;
  output["sessions"] = Json::array();
  for (const Session& session : recording.sessions)
    output["sessions"].push_back(json_from(session));
  return format_json(output);
}

RecordingDocument read_recording(const std::filesystem::path& file) {
  return parse_recording(read_file(file), file.string());
}

void write_recording(const RecordingDocument& recording, const std::filesystem::path& file) {
  const std::string text = format_recording(recording);
  parse_recording(text, file.string());  // what cannot be read again must not be written
  write_file_atomically(file, text);
}

}  // namespace raystage
