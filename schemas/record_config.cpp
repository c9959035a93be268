// SPDX-License-Identifier: Apache-2.0
#include "schemas/record_config.h"

#include <fmt/format.h>

#include <array>
#include <set>
#include <utility>

#include "base/atomic_file.h"
#include "schemas/document.h"

namespace raystage {
namespace {

using nlohmann::ordered_json;

/// An enumeration's values in the words of the document.
template <typename Value, std::size_t count>
using Words = std::array<std::pair<Value, const char*>, count>;

constexpr Words<RecordConfig::OverflowPolicy, 2> kWhenFull{
    {{RecordConfig::OverflowPolicy::kDropNewest, "drop_newest"},
     {RecordConfig::OverflowPolicy::kDropOldest, "drop_oldest"}}};
constexpr Words<RecordConfig::LostSourcePolicy, 3> kWhenLost{
    {{RecordConfig::LostSourcePolicy::kContinue, "continue"},
     {RecordConfig::LostSourcePolicy::kReconnect, "reconnect"},
     {RecordConfig::LostSourcePolicy::kStop, "stop"}}};
constexpr Words<RecordConfig::Chroma, 3> kChroma{{{RecordConfig::Chroma::k444, "444"},
                                                  {RecordConfig::Chroma::k422, "422"},
                                                  {RecordConfig::Chroma::k420, "420"}}};

/// Reads one of the words, which the schema has checked.
template <typename Value, std::size_t count>
void read_word(const JsonNode& object, std::string_view key, const Words<Value, count>& words,
               Value& value) {
  if (!object.has(key)) return;
  const auto text = object.at(key).template get<std::string>();
  for (const auto& [meaning, word] : words) {
    if (text == word) value = meaning;
  }
}

template <typename Value, std::size_t count>
const char* word_of(Value value, const Words<Value, count>& words) {
  for (const auto& [meaning, word] : words) {
    if (meaning == value) return word;
  }
  return words.front().second;
}

/// Returns text for another library. Rejects control characters, which may truncate it.
std::string plain_text(const JsonNode& object, std::string_view key) {
  if (!object.has(key)) return {};
  const JsonNode text = object.at(key);
  auto result = text.get<std::string>();
  for (const char c : result) {
    if (static_cast<unsigned char>(c) < ' ') {
      throw text.input_error(
          fmt::format("found {}, text with a control character", describe_json_value(text.value)),
          "Remove it");
    }
  }
  return result;
}

template <typename T>
void read_optional(const JsonNode& object, std::string_view key, std::optional<T>& value) {
  if (object.has(key)) value = object.at(key).template get<T>();
}

void add_text(ordered_json& object, const char* key, const std::string& text) {
  if (!text.empty()) object[key] = text;
}

RecordConfig::FfmpegSource ffmpeg_from(const JsonNode& object) {
  RecordConfig::FfmpegSource source;
  source.url = plain_text(object, "url");
  source.format = plain_text(object, "format");
  source.realtime = object.get("realtime", source.realtime);
  if (!object.has("options")) return source;
  const JsonNode options = object.at("options");
  for (const auto& [key, value] : options.value.items()) {
    if (key.empty() || !value.is_string()) {
      throw options.at(key).input_error(
          fmt::format("found {}, allowed: an option's value as text", describe_json_value(value)),
          "Write it as a string, as on FFmpeg's command line");
    }
    source.options.emplace(key, plain_text(options, key));
  }
  return source;
}

RecordConfig::AravisSource aravis_from(const JsonNode& object) {
  RecordConfig::AravisSource source;
  source.device = plain_text(object, "device");
  read_optional(object, "exposure_us", source.exposure_us);
  read_optional(object, "gain", source.gain);
  read_optional(object, "fps", source.fps);
  source.trigger = plain_text(object, "trigger");
  source.pixel_format = plain_text(object, "pixel_format");
  read_optional(object, "packet_size", source.packet_size);
  source.buffers = object.get("buffers", source.buffers);
  source.packet_resend = object.get("packet_resend", source.packet_resend);
  source.packet_socket = object.get("packet_socket", source.packet_socket);
  source.socket_buffer_bytes = object.get("socket_buffer_bytes", source.socket_buffer_bytes);
  return source;
}

RecordConfig::SimulatedSource simulated_from(const JsonNode& object) {
  RecordConfig::SimulatedSource source;
  source.scene = object.has("scene") ? plain_text(object, "scene") : source.scene;
  source.seed = object.get("seed", source.seed);
  source.rows = object.get("rows", source.rows);
  source.columns = object.get("columns", source.columns);
  source.index = object.get("index", source.index);
  source.width = object.get("width", source.width);
  source.height = object.get("height", source.height);
  source.fps = object.get("fps", source.fps);
  source.seconds = object.get("seconds", source.seconds);
  source.jpeg = object.get("jpeg", source.jpeg);
  const int cameras = source.rows * source.columns;
  if (source.index >= cameras) {
    throw object.at("index").input_error(
        fmt::format("found {}, allowed: less than the {} cameras of the array", source.index,
                    cameras),
        "Correct the index, or \"rows\" and \"columns\"");
  }
  return source;
}

RecordConfig::Source source_from(const JsonNode& camera) {
  const bool ffmpeg = camera.has("ffmpeg"), aravis = camera.has("aravis"),
             simulated = camera.has("simulated");
  if (static_cast<int>(ffmpeg) + static_cast<int>(aravis) + static_cast<int>(simulated) != 1) {
    throw camera.input_error(
        fmt::format("found {}, allowed: one of \"ffmpeg\", \"aravis\" and \"simulated\"",
                    ffmpeg || aravis || simulated ? "several sources" : "no source"),
        "Give each camera exactly one source");
  }
  if (ffmpeg) return ffmpeg_from(camera.at("ffmpeg"));
  if (aravis) return aravis_from(camera.at("aravis"));
  return simulated_from(camera.at("simulated"));
}

ordered_json json_from(const RecordConfig::FfmpegSource& source) {
  ordered_json object{{"url", source.url}};
  add_text(object, "format", source.format);
  if (!source.options.empty()) object["options"] = source.options;
  object["realtime"] = source.realtime;
  return object;
}

ordered_json json_from(const RecordConfig::AravisSource& source) {
  ordered_json object = ordered_json::object();
  add_text(object, "device", source.device);
  add_optional(object, "exposure_us", source.exposure_us);
  add_optional(object, "gain", source.gain);
  add_optional(object, "fps", source.fps);
  add_text(object, "trigger", source.trigger);
  add_text(object, "pixel_format", source.pixel_format);
  add_optional(object, "packet_size", source.packet_size);
  object["buffers"] = source.buffers;
  object["packet_resend"] = source.packet_resend;
  object["packet_socket"] = source.packet_socket;
  object["socket_buffer_bytes"] = source.socket_buffer_bytes;
  return object;
}

ordered_json json_from(const RecordConfig::SimulatedSource& source) {
  return {{"scene", source.scene},     {"seed", source.seed},   {"rows", source.rows},
          {"columns", source.columns}, {"index", source.index}, {"width", source.width},
          {"height", source.height},   {"fps", source.fps},     {"seconds", source.seconds},
          {"jpeg", source.jpeg}};
}

/// The property of a camera that holds its source.
const char* kind_of(const RecordConfig::Source& source) {
  if (std::holds_alternative<RecordConfig::FfmpegSource>(source)) return "ffmpeg";
  if (std::holds_alternative<RecordConfig::AravisSource>(source)) return "aravis";
  return "simulated";
}

}  // namespace

RecordConfig parse_record_config(std::string_view text, std::string_view name) {
  const nlohmann::json json = parse_document("record", text, name);
  const JsonNode document{json, name, ""};
  RecordConfig config;
  config.name = document.at("name").get<std::string>();
  config.node = plain_text(document, "node");
  if (document.has("rig")) config.rig = path_from(document.at("rig"));
  config.nominal_fps = document.get("nominal_fps", config.nominal_fps);
  config.color_space = document.get("color_space", config.color_space);
  config.memory_mb = document.get("memory_mb", config.memory_mb);
  config.hold = document.get("buffer_in_memory", config.hold);
  read_word(document, "when_full", kWhenFull, config.when_full);
  read_word(document, "when_lost", kWhenLost, config.when_lost);
  config.lost_after_seconds = document.get("lost_after_seconds", config.lost_after_seconds);
  if (document.has("jpeg")) {
    const JsonNode jpeg = document.at("jpeg");
    config.quality = jpeg.get("quality", config.quality);
    read_word(jpeg, "chroma", kChroma, config.chroma);
    config.restart_interval = jpeg.get("restart_interval", config.restart_interval);
  }
  const JsonNode cameras = document.at("cameras");
  std::set<std::string, std::less<>> seen;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const JsonNode camera = cameras.at(i);
    std::string id = unique_id_from(camera, seen);
    config.cameras.push_back({std::move(id), source_from(camera)});
  }
  return config;
}

std::string format_record_config(const RecordConfig& config) {
  ordered_json json = make_document("record");
  json["name"] = config.name;
  add_text(json, "node", config.node);
  add_text(json, "rig", config.rig);
  if (config.nominal_fps > 0) json["nominal_fps"] = config.nominal_fps;
  json["color_space"] = config.color_space;
  json["memory_mb"] = config.memory_mb;
  json["buffer_in_memory"] = config.hold;
  json["when_full"] = word_of(config.when_full, kWhenFull);
  json["when_lost"] = word_of(config.when_lost, kWhenLost);
  json["lost_after_seconds"] = config.lost_after_seconds;
  ordered_json& jpeg = json["jpeg"];
  jpeg = {{"quality", config.quality}, {"chroma", word_of(config.chroma, kChroma)}};
  if (config.restart_interval >= 0) jpeg["restart_interval"] = config.restart_interval;
  ordered_json& cameras = json["cameras"] = ordered_json::array();
  for (const RecordConfig::Camera& camera : config.cameras) {
    ordered_json object{{"id", camera.id}};
    object[kind_of(camera.source)] =
        std::visit([](const auto& source) { return json_from(source); }, camera.source);
    cameras.push_back(std::move(object));
  }
  return format_json(json);
}

RecordConfig read_record_config(const std::filesystem::path& file) {
  return parse_record_config(read_file(file), file.string());
}

}  // namespace raystage
