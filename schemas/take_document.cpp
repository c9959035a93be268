// SPDX-License-Identifier: Apache-2.0
#include "schemas/take_document.h"

#include "base/atomic_file.h"
#include "schemas/document.h"

namespace raystage {

TakeDocument parse_take(std::string_view text, std::string_view name) {
  const nlohmann::json json = parse_document("take", text, name);
  const JsonNode document{json, name, ""};
  TakeDocument take;
  take.name = document.get("name", take.name);
  take.created_by = document.get("created_by", take.created_by);
  if (document.has("derived_from")) {
    const JsonNode derived = document.at("derived_from");
    take.derived_from = {derived.at("take").get<std::string>(),
                         derived.at("by").get<std::string>()};
  }
  take.epoch_utc = utc_from(document.at("epoch_utc"));
  take.nominal_fps = document.at("nominal_fps").get<double>();
  take.color_space = document.at("color_space").get<std::string>();
  take.clock = document.get("clock", take.clock);
  take.timestamp_event = document.get("timestamp_event", take.timestamp_event);
  take.arbitrary_scale = document.get<std::string>("scale", "metres") == "arbitrary";
  take.depth_range = depth_range_from(document);
  const JsonNode cameras = document.at("cameras");
  std::set<std::string, std::less<>> seen;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const JsonNode object = cameras.at(i);
    take.cameras.push_back({.id = unique_id_from(object, seen),
                            .archive = relative_path_from(object.at("archive")),
                            .journal = relative_path_from(object.at("journal")),
                            .node = object.get<std::string>("node", "")});
    if (object.has("archive_epoch_utc")) {
      take.cameras.back().archive_epoch_utc = utc_from(object.at("archive_epoch_utc"));
    }
  }
  return take;
}

std::string format_take(const TakeDocument& take) {
  nlohmann::ordered_json json = make_document("take");
  json["name"] = take.name;
  json["created_by"] = take.created_by;
  if (take.derived_from) {
    json["derived_from"] = {{"take", take.derived_from->take}, {"by", take.derived_from->by}};
  }
  json["epoch_utc"] = format_utc(take.epoch_utc);
  json["nominal_fps"] = take.nominal_fps;
  json["color_space"] = take.color_space;
  json["clock"] = take.clock;
  json["timestamp_event"] = take.timestamp_event;
  if (take.arbitrary_scale) json["scale"] = "arbitrary";
  add_depth_range(take.depth_range, json);
  auto& cameras = json["cameras"] = nlohmann::ordered_json::array();
  for (const TakeDocument::Camera& camera : take.cameras) {
    nlohmann::ordered_json object{
        {"id", camera.id}, {"archive", camera.archive}, {"journal", camera.journal}};
    if (!camera.node.empty()) object["node"] = camera.node;
    if (camera.archive_epoch_utc) {
      object["archive_epoch_utc"] = format_utc(*camera.archive_epoch_utc);
    }
    cameras.push_back(std::move(object));
  }
  return format_json(json);
}

TakeDocument read_take(const std::filesystem::path& file) {
  return parse_take(read_file(file), file.string());
}

void write_take(const TakeDocument& take, const std::filesystem::path& file) {
  const std::string text = format_take(take);
  parse_take(text, file.string());  // what cannot be read again must not be written
  write_file_atomically(file, text);
}

}  // namespace raystage
