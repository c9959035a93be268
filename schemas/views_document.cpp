// SPDX-License-Identifier: Apache-2.0
#include "schemas/views_document.h"

#include "base/atomic_file.h"
#include "schemas/document.h"

namespace raystage {

ViewsDocument parse_views(std::string_view text, std::string_view name) {
  const nlohmann::json json = parse_document("views", text, name);
  const JsonNode document{json, name, ""};
  ViewsDocument result;
  result.color_space = document.at("color_space").get<std::string>();
  const JsonNode views = document.at("views");
  std::set<std::string, std::less<>> seen;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const JsonNode object = views.at(i);
    result.views.push_back({.geometry = camera_from(object, seen),
                            .file = object.has("file") ? path_from(object.at("file")) : "",
                            .time_ns = object.get<Nanoseconds>("time_ns", 0)});
  }
  return result;
}

std::string format_views(const ViewsDocument& views) {
  nlohmann::ordered_json json = make_document("views");
  json["color_space"] = views.color_space;
  auto& list = json["views"] = nlohmann::ordered_json::array();
  for (const ViewsDocument::View& view : views.views) {
    CameraGeometry geometry = view.geometry;
    geometry.row = geometry.column = std::nullopt;  // a view has no place in the array
    nlohmann::ordered_json object = json_from(geometry);
    if (!view.file.empty()) object["file"] = view.file;
    object["time_ns"] = view.time_ns;
    list.push_back(std::move(object));
  }
  return format_json(json);
}

ViewsDocument read_views(const std::filesystem::path& file) {
  return parse_views(read_file(file), file.string());
}

void write_views(const ViewsDocument& views, const std::filesystem::path& file) {
  const std::string text = format_views(views);
  parse_views(text, file.string());  // what cannot be read again must not be written
  write_file_atomically(file, text);
}

}  // namespace raystage
