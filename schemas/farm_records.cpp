// SPDX-License-Identifier: Apache-2.0
#include "schemas/farm_records.h"

#include "schemas/fields.h"
#include "schemas/utf8_text.h"

namespace raystage::schemas {
namespace {

using Costs = RenderStageCosts;
using End = FarmAttempt::End;

constexpr auto kResultNames = enum_names<AttemptResult>("done", "failed", "bad_input",
                                                        "out_of_memory", "stopped", "declined");
constexpr auto kEndNames = enum_names<FarmEnd::State>("done", "failed", "cancelled", "stopped");

std::string text_from(const JsonNode& node) { return node.get<std::string>(); }

/// Messages of other programs may be invalid or cut within a character.
std::string as_utf8(const std::string& text) { return utf8_text(text, std::string::npos); }
constexpr Converter kUtf8(text_from, as_utf8);

constexpr Fields kRendering(
    required("frames", &Costs::frames), defaulted("frames_in_flight", &Costs::frames_in_flight),
    defaulted("seconds", &Costs::seconds), defaulted("light_fields_s", &Costs::light_fields_s),
    defaulted("geometry_s", &Costs::geometry_s), defaulted("merge_s", &Costs::merge_s),
    defaulted("encode_s", &Costs::encode_s), defaulted("write_s", &Costs::write_s),
    defaulted("decode_s", &Costs::decode_s), defaulted("read_bytes", &Costs::read_bytes));

constexpr Fields kAttemptEnd(
    required("result", &End::result, kResultNames), required("exit_code", &End::exit_code),
    optional("reason", &End::reason, kUtf8), optional("node_fault", &End::node_fault),
    optional("failed_frames", &End::failed_frames), defaulted("wall_seconds", &End::wall_seconds),
    defaulted("cpu_seconds", &End::cpu_seconds),
    defaulted("peak_memory_bytes", &End::peak_memory_bytes),
    defaulted("light_field_frames_solved", &End::light_field_frames_estimated),
    defaulted("light_field_frames_loaded", &End::light_field_frames_loaded),
    optional("rendering", &End::rendering, kRendering),
    optional("ended_utc", &End::ended_utc, kUtc));

constexpr Fields kAttempt(
    required("stage", &FarmAttempt::stage), required("index", &FarmAttempt::index),
    required("attempt", &FarmAttempt::attempt), defaulted("round", &FarmAttempt::round),
    required("node", &FarmAttempt::node, kUtf8), defaulted("process", &FarmAttempt::process),
    written_if([](const FarmAttempt& attempt) { return !attempt.slurm_task.empty(); },
               defaulted("slurm_task", &FarmAttempt::slurm_task),
               defaulted("restart", &FarmAttempt::restart)),
    optional("build", &FarmAttempt::build), optional("frames", &FarmAttempt::frames),
    required("started_utc", &FarmAttempt::started_utc, kUtc),
    optional("end", &FarmAttempt::end, kAttemptEnd));

constexpr Fields kRound(
    required("round", &FarmRound::round), required("prepare", &FarmRound::prepare),
    required("render", &FarmRound::render), defaulted("memory_factor", &FarmRound::memory_factor),
    defaulted("time_factor", &FarmRound::time_factor), optional("exclude", &FarmRound::exclude),
    optional("frames", &FarmRound::frames), optional("resets_attempts", &FarmRound::fresh),
    written_if([](const FarmRound& round) { return !round.host.empty(); },
               defaulted("host", &FarmRound::host), defaulted("process", &FarmRound::process),
               defaulted("process_start", &FarmRound::process_start)));

constexpr Fields kFarmEnd(required("state", &FarmEnd::state, kEndNames),
                          optional("reason", &FarmEnd::reason, kUtf8),
                          optional("missing_frames", &FarmEnd::missing_frames),
                          optional("frames_below_coverage", &FarmEnd::frames_below_coverage),
                          optional("frames_with_rot", &FarmEnd::frames_with_rot),
                          defaulted("frames", &FarmEnd::frames),
                          required("ended_utc", &FarmEnd::ended_utc, kUtc));

}  // namespace

std::string_view attempt_result_name(AttemptResult result) { return kResultNames.name(result); }

FarmAttempt parse_farm_attempt(std::string_view text, std::string_view name) {
  return parse_document_as<FarmAttempt>("farm_attempt", kAttempt, text, name);
}

std::string format_farm_attempt(const FarmAttempt& attempt) {
  return format_document("farm_attempt", kAttempt, attempt);
}

FarmRound parse_farm_round(std::string_view text, std::string_view name) {
  return parse_document_as<FarmRound>("farm_round", kRound, text, name);
}

std::string format_farm_round(const FarmRound& round) {
  return format_document("farm_round", kRound, round);
}

std::string_view farm_end_state_name(FarmEnd::State state) { return kEndNames.name(state); }

FarmEnd parse_farm_end(std::string_view text, std::string_view name) {
  return parse_document_as<FarmEnd>("farm_end", kFarmEnd, text, name);
}

std::string format_farm_end(const FarmEnd& end) {
  return format_document("farm_end", kFarmEnd, end);
}

}  // namespace raystage::schemas
