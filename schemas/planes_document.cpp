// SPDX-License-Identifier: Apache-2.0
#include "schemas/planes_document.h"

#include "base/atomic_file.h"
#include "schemas/document.h"

namespace raystage {

PlanesDocument parse_planes(std::string_view text, std::string_view name) {
  const nlohmann::json json = parse_document("planes", text, name);
  const JsonNode document{json, name, ""};
  PlanesDocument planes;
  std::set<std::string, std::less<>> seen;
  const JsonNode list = document.at("planes");
  for (std::size_t i = 0; i < list.size(); ++i) {
    const JsonNode object = list.at(i);
    PlanesDocument::Plane plane;
    plane.id = unique_id_from(object, seen);
    plane.corners = object.at("corners").get<std::vector<std::array<double, 3>>>();
    planes.planes.push_back(std::move(plane));
  }
  return planes;
}

std::string format_planes(const PlanesDocument& planes) {
  nlohmann::ordered_json json = make_document("planes");
  auto& list = json["planes"] = nlohmann::ordered_json::array();
  for (const PlanesDocument::Plane& plane : planes.planes) {
    list.push_back({{"id", plane.id}, {"corners", plane.corners}});
  }
  return format_json(json);
}

PlanesDocument read_planes(const std::filesystem::path& file) {
  return parse_planes(read_file(file), file.string());
}

}  // namespace raystage
