// SPDX-License-Identifier: Apache-2.0
#include "schemas/farm_records.h"

#include <array>

#include "schemas/document.h"

namespace raystage {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<std::string_view, 6> kResultNames{"done",          "failed",  "bad_input",
                                                       "out_of_memory", "stopped", "declined"};
constexpr std::array<std::string_view, 4> kEndNames{"done", "failed", "cancelled", "stopped"};

/// Returns the enumerator of a name; the schema has already rejected other names.
template <class Enum, std::size_t n>
Enum enum_from(const std::array<std::string_view, n>& names, const std::string& word) {
  std::size_t i = 0;
  while (i + 1 < n && names[i] != word) ++i;
  return static_cast<Enum>(i);
}

/// Messages of other programs may be invalid UTF-8 or cut within a character.
std::string as_utf8(const std::string& text) {
  const std::string dumped = Json(text).dump(-1, ' ', false, Json::error_handler_t::replace);
  return Json::parse(dumped).get<std::string>();
}

RenderStageCosts rendering_from(const JsonNode& object) {
  RenderStageCosts costs;
  costs.frames = object.at("frames").get<int>();
  costs.frames_in_flight = object.get("frames_in_flight", 1);
  costs.seconds = object.get("seconds", 0.0);
  costs.light_fields_s = object.get("light_fields_s", 0.0);
  costs.geometry_s = object.get("geometry_s", 0.0);
  costs.merge_s = object.get("merge_s", 0.0);
  costs.encode_s = object.get("encode_s", 0.0);
  costs.write_s = object.get("write_s", 0.0);
  costs.decode_s = object.get("decode_s", 0.0);
  costs.read_bytes = object.get("read_bytes", 0.0);
  return costs;
}

Json json_from(const RenderStageCosts& costs) {
  return {{"frames", costs.frames},         {"frames_in_flight", costs.frames_in_flight},
          {"seconds", costs.seconds},       {"light_fields_s", costs.light_fields_s},
          {"geometry_s", costs.geometry_s}, {"merge_s", costs.merge_s},
          {"encode_s", costs.encode_s},     {"write_s", costs.write_s},
          {"decode_s", costs.decode_s},     {"read_bytes", costs.read_bytes}};
}

FarmAttempt::End end_from(const JsonNode& object) {
  FarmAttempt::End end;
  end.result = enum_from<AttemptResult>(kResultNames, object.at("result").get<std::string>());
  end.exit_code = object.at("exit_code").get<int>();
  end.reason = object.get<std::string>("reason", "");
  end.node_fault = object.get("node_fault", false);
  end.failed_frames = object.get<std::string>("failed_frames", "");
  end.wall_seconds = object.get("wall_seconds", 0.0);
  end.cpu_seconds = object.get("cpu_seconds", 0.0);
  end.peak_memory_bytes = object.get("peak_memory_bytes", 0.0);
  end.light_field_frames_estimated = object.get("light_field_frames_solved", 0);
  end.light_field_frames_loaded = object.get("light_field_frames_loaded", 0);
  if (object.has("rendering")) end.rendering = rendering_from(object.at("rendering"));
  if (object.has("ended_utc")) end.ended_utc = utc_from(object.at("ended_utc"));
  return end;
}

Json json_from(const FarmAttempt::End& end) {
  Json output{{"result", attempt_result_name(end.result)}, {"exit_code", end.exit_code}};
  if (!end.reason.empty()) output["reason"] = as_utf8(end.reason);
  if (end.node_fault) output["node_fault"] = true;
  if (!end.failed_frames.empty()) output["failed_frames"] = end.failed_frames;
  output["wall_seconds"] = end.wall_seconds;
  output["cpu_seconds"] = end.cpu_seconds;
  output["peak_memory_bytes"] = end.peak_memory_bytes;
  output["light_field_frames_solved"] = end.light_field_frames_estimated;
  output["light_field_frames_loaded"] = end.light_field_frames_loaded;
  if (end.rendering) output["rendering"] = json_from(*end.rendering);
  if (end.ended_utc) output["ended_utc"] = format_utc(*end.ended_utc);
  return output;
}

}  // namespace

std::string_view attempt_result_name(AttemptResult result) {
  return kResultNames[static_cast<std::size_t>(result)];
}

FarmAttempt parse_farm_attempt(std::string_view text, std::string_view name) {
  const nlohmann::json output = parse_document("farm_attempt", text, name);
  const JsonNode document{output, name, ""};
  FarmAttempt attempt;
  attempt.stage = document.at("stage").get<std::string>();
  attempt.index = document.at("index").get<int>();
  attempt.attempt = document.at("attempt").get<int>();
  attempt.round = document.get("round", 0);
  attempt.node = document.at("node").get<std::string>();
  attempt.process = document.get<std::int64_t>("process", 0);
  attempt.slurm_task = document.get<std::string>("slurm_task", "");
  attempt.restart = document.get("restart", 0);
  attempt.build = document.get<std::string>("build", "");
  attempt.frames = document.get<std::string>("frames", "");
  attempt.started_utc = utc_from(document.at("started_utc"));
  if (document.has("end")) attempt.end = end_from(document.at("end"));
  return attempt;
}

std::string format_farm_attempt(const FarmAttempt& attempt) {
  Json output = make_document("farm_attempt");
  output["stage"] = attempt.stage;
  output["index"] = attempt.index;
  output["attempt"] = attempt.attempt;
  output["round"] = attempt.round;
  output["node"] = as_utf8(attempt.node);
  output["process"] = attempt.process;
  if (!attempt.slurm_task.empty()) {
    output["slurm_task"] = attempt.slurm_task;
    output["restart"] = attempt.restart;
  }
  if (!attempt.build.empty()) output["build"] = attempt.build;
  if (!attempt.frames.empty()) output["frames"] = attempt.frames;
  output["started_utc"] = format_utc(attempt.started_utc);
  if (attempt.end) output["end"] = json_from(*attempt.end);
  return format_json(output);
}

FarmRound parse_farm_round(std::string_view text, std::string_view name) {
  const nlohmann::json output = parse_document("farm_round", text, name);
  const JsonNode document{output, name, ""};
  FarmRound round;
  round.round = document.at("round").get<int>();
  round.prepare = document.at("prepare").get<std::vector<int>>();
  round.render = document.at("render").get<std::vector<int>>();
  round.memory_factor = document.get("memory_factor", 1.0);
  round.time_factor = document.get("time_factor", 1.0);
  round.exclude = document.get<std::vector<std::string>>("exclude", {});
  round.frames = document.get<std::string>("frames", "");
  round.fresh = document.get("resets_attempts", false);
  round.host = document.get<std::string>("host", "");
  round.process = document.get<std::int64_t>("process", 0);
  round.process_start = document.get<std::string>("process_start", "");
  return round;
}

std::string format_farm_round(const FarmRound& round) {
  Json output = make_document("farm_round");
  output["round"] = round.round;
  output["prepare"] = round.prepare;
  output["render"] = round.render;
  output["memory_factor"] = round.memory_factor;
  output["time_factor"] = round.time_factor;
  if (!round.exclude.empty()) output["exclude"] = round.exclude;
  if (!round.frames.empty()) output["frames"] = round.frames;
  if (round.fresh) output["resets_attempts"] = true;
  if (!round.host.empty()) {
    output["host"] = round.host;
    output["process"] = round.process;
    output["process_start"] = round.process_start;
  }
  return format_json(output);
}

std::string_view farm_end_state_name(FarmEnd::State state) {
  return kEndNames[static_cast<std::size_t>(state)];
}

FarmEnd parse_farm_end(std::string_view text, std::string_view name) {
  const nlohmann::json output = parse_document("farm_end", text, name);
  const JsonNode document{output, name, ""};
  return {enum_from<FarmEnd::State>(kEndNames, document.at("state").get<std::string>()),
          document.get<std::string>("reason", ""), document.get<std::string>("missing_frames", ""),
          document.get("frames", 0), utc_from(document.at("ended_utc"))};
}

std::string format_farm_end(const FarmEnd& end) {
  Json output = make_document("farm_end");
  output["state"] = farm_end_state_name(end.state);
  if (!end.reason.empty()) output["reason"] = as_utf8(end.reason);
  if (!end.missing_frames.empty()) output["missing_frames"] = end.missing_frames;
  output["frames"] = end.frames;
  output["ended_utc"] = format_utc(end.ended_utc);
  return format_json(output);
}

}  // namespace raystage
