// SPDX-License-Identifier: Apache-2.0
#include "schemas/rig_document.h"

#include "base/atomic_file.h"
#include "schemas/document.h"

namespace raystage {

RigDocument parse_rig(std::string_view text, std::string_view name) {
  const nlohmann::json json = parse_document("rig", text, name);
  const JsonNode document{json, name, ""};
  RigDocument rig;
  rig.name = document.get("name", rig.name);
  rig.topology = document.get("topology", rig.topology);
  const JsonNode cameras = document.at("cameras");
  std::set<std::string, std::less<>> seen;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const JsonNode object = cameras.at(i);
    RigDocument::Camera camera{camera_from(object, seen), {}};
    if (object.has("photometric")) {
      camera.photometric = photometric_from(object.at("photometric"), camera.geometry);
    }
    rig.cameras.push_back(std::move(camera));
  }
  return rig;
}

std::string format_rig(const RigDocument& rig) {
  nlohmann::ordered_json json = make_document("rig");
  json["name"] = rig.name;
  json["topology"] = rig.topology;
  auto& cameras = json["cameras"] = nlohmann::ordered_json::array();
  for (const RigDocument::Camera& camera : rig.cameras) {
    nlohmann::ordered_json object = json_from(camera.geometry);
    if (camera.photometric != PhotometricResponse{}) {
      object["photometric"] = json_from(camera.photometric);
    }
    cameras.push_back(std::move(object));
  }
  return format_json(json);
}

RigDocument read_rig(const std::filesystem::path& file) {
  return parse_rig(read_file(file), file.string());
}

void write_rig(const RigDocument& rig, const std::filesystem::path& file) {
  const std::string text = format_rig(rig);
  parse_rig(text, file.string());  // what cannot be read again must not be written
  write_file_atomically(file, text);
}

}  // namespace raystage
