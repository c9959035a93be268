// SPDX-License-Identifier: Apache-2.0
#include "schemas/detections_document.h"

#include <functional>
#include <set>

#include "base/atomic_file.h"
#include "schemas/document.h"

namespace raystage {

DetectionsDocument parse_detections_document(std::string_view text, std::string_view name) {
  const nlohmann::json json = parse_document("detections", text, name);
  const JsonNode cameras = JsonNode{json, name, ""}.at("cameras");
  DetectionsDocument document;
  std::set<std::string, std::less<>> seen;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const JsonNode object = cameras.at(i);
    document.cameras.push_back({unique_id_from(object, seen), object.at("width").get<int>(),
                                object.at("height").get<int>()});
  }
  return document;
}

std::string format_detections_document(const DetectionsDocument& document) {
  nlohmann::ordered_json json = make_document("detections");
  auto& cameras = json["cameras"] = nlohmann::ordered_json::array();
  for (const DetectionsDocument::Camera& camera : document.cameras) {
    cameras.push_back({{"id", camera.id}, {"width", camera.width}, {"height", camera.height}});
  }
  return format_json(json);
}

DetectionsDocument read_detections_document(const std::filesystem::path& file) {
  return parse_detections_document(read_file(file), file.string());
}

void write_detections_document(const DetectionsDocument& document,
                               const std::filesystem::path& file) {
  const std::string text = format_detections_document(document);
  parse_detections_document(text, file.string());  // what cannot be read again must not be written
  write_file_atomically(file, text);
}

}  // namespace raystage
