// SPDX-License-Identifier: Apache-2.0
#include "schemas/recording_document.h"

#include "schemas/atomic_file.h"
#include "schemas/document.h"

namespace raystage {
namespace {

using Json = nlohmann::ordered_json;
using Camera = RecordingDocument::Camera;
using Session = RecordingDocument::Session;

std::vector<RecordingDocument::Event> events_from(const Located& camera) {
  std::vector<RecordingDocument::Event> events;
  if (!camera.has("events")) return events;
  const Located list = camera.at("events");
  for (std::size_t i = 0; i < list.size(); ++i) {
    const Located event = list.at(i);
    events.push_back({utc_from(event.at("time_utc")), event.at("what").get<std::string>()});
  }
  return events;
}

Camera camera_from_session(const Located& object, std::set<std::string, std::less<>>& seen) {
  Camera camera;
  camera.id = unique_id(object, seen);
  camera.source = object.at("source").get<std::string>();
  camera.clock = object.at("clock").get<std::string>();
  camera.time_marks = object.at("time_marks").get<std::string>();
  camera.arrived = object.get<std::uint64_t>("arrived", 0);
  camera.stored = object.get<std::uint64_t>("stored", 0);
  if (object.has("dropped")) {
    camera.dropped = object.at("dropped").get<std::map<std::string, std::uint64_t>>();
  }
  camera.skipped_by_source = object.get<std::uint64_t>("skipped_by_source", 0);
  camera.corrected_times = object.get<std::uint64_t>("corrected_times", 0);
  camera.events = events_from(object);
  return camera;
}

Session session_from(const Located& object) {
  Session session;
  session.program = object.at("program").get<std::string>();
  session.started_utc = utc_from(object.at("started_utc"));
  if (object.has("start_at_utc")) session.start_at_utc = utc_from(object.at("start_at_utc"));
  if (object.has("stopped_utc")) session.stopped_utc = utc_from(object.at("stopped_utc"));
  session.why_stopped = object.get<std::string>("why_stopped", "");
  session.memory_bytes = object.at("memory_bytes").get<std::uint64_t>();
  session.memory_peak_bytes = object.get<std::uint64_t>("memory_peak_bytes", 0);
  session.held = object.at("held").get<bool>();
  const Located clock = object.at("clock");
  session.clock.source = clock.at("source").get<std::string>();
  if (clock.has("offset_s")) session.clock.offset_s = clock.at("offset_s").get<double>();
  if (clock.has("max_error_s")) session.clock.max_error_s = clock.at("max_error_s").get<double>();
  const Located cameras = object.at("cameras");
  std::set<std::string, std::less<>> seen;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    session.cameras.push_back(camera_from_session(cameras.at(i), seen));
  }
  if (object.has("audit")) {
    const Located audit = object.at("audit");
    session.audit = {audit.at("holds").get<bool>(),
                     audit.at("complaints").get<std::vector<std::string>>()};
  }
  return session;
}

Json json_from(const Camera& camera) {
  Json json{{"id", camera.id},
            {"source", camera.source},
            {"clock", camera.clock},
            {"time_marks", camera.time_marks},
            {"arrived", camera.arrived},
            {"stored", camera.stored},
            {"dropped", Json::object()},
            {"skipped_by_source", camera.skipped_by_source},
            {"corrected_times", camera.corrected_times},
            {"events", Json::array()}};
  for (const auto& [reason, count] : camera.dropped) json["dropped"][reason] = count;
  for (const RecordingDocument::Event& event : camera.events) {
    json["events"].push_back({{"time_utc", format_utc(event.time_utc)}, {"what", event.what}});
  }
  return json;
}

Json json_from(const Session& session) {
  Json json{{"program", session.program}, {"started_utc", format_utc(session.started_utc)}};
  if (session.start_at_utc) json["start_at_utc"] = format_utc(*session.start_at_utc);
  if (session.stopped_utc) json["stopped_utc"] = format_utc(*session.stopped_utc);
  if (!session.why_stopped.empty()) json["why_stopped"] = session.why_stopped;
  json["memory_bytes"] = session.memory_bytes;
  json["memory_peak_bytes"] = session.memory_peak_bytes;
  json["held"] = session.held;
  json["clock"] = {{"source", session.clock.source}};
  if (session.clock.offset_s) json["clock"]["offset_s"] = *session.clock.offset_s;
  if (session.clock.max_error_s) json["clock"]["max_error_s"] = *session.clock.max_error_s;
  json["cameras"] = Json::array();
  for (const Camera& camera : session.cameras) json["cameras"].push_back(json_from(camera));
  if (session.audit) {
    json["audit"] = {{"holds", session.audit->holds}, {"complaints", session.audit->complaints}};
  }
  return json;
}

}  // namespace

RecordingDocument parse_recording(std::string_view text, std::string_view name) {
  const nlohmann::json json = parse_document("recording", text, name);
  const Located document{json, name, ""};
  RecordingDocument recording;
  recording.node = document.at("node").get<std::string>();
  const Located sessions = document.at("sessions");
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    recording.sessions.push_back(session_from(sessions.at(i)));
  }
  return recording;
}

std::string format_recording(const RecordingDocument& recording) {
  Json json = new_document("recording");
  json["node"] = recording.node;
  json["sessions"] = Json::array();
  for (const Session& session : recording.sessions) json["sessions"].push_back(json_from(session));
  return format_json(json);
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
