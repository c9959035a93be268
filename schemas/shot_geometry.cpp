// SPDX-License-Identifier: Apache-2.0
#include "schemas/shot_geometry.h"

#include <fmt/format.h>

namespace raystage {
namespace {

using nlohmann::ordered_json;
using Geometry = ShotDocument::Geometry;
using Light = ShotDocument::Light;
using Material = ShotDocument::Material;
using TransformKey = ShotDocument::TransformKey;
using Three = std::array<double, 3>;

Material material_from(const JsonNode& object) {
  Material material;
  material.kind = object.get("kind", material.kind);
  material.color = object.get_if<Three>("color");
  if (object.has("texture")) material.texture = path_from(object.at("texture"));
  material.roughness = object.get("roughness", material.roughness);
  if (object.has("roughness") && material.kind != "glossy") {
    throw object.at("roughness")
        .input_error("only glossy materials have this property",
                     "Remove it, or write \"kind\": \"glossy\"");
  }
  return material;
}

ordered_json json_from(const Material& material) {
  ordered_json object{{"kind", material.kind}};
  add_optional(object, "color", material.color);
  if (!material.texture.empty()) object["texture"] = material.texture;
  if (material.kind == "glossy") object["roughness"] = material.roughness;
  return object;
}

TransformKey transform_key_from(const JsonNode& object) {
  TransformKey key;
  key.frame = object.at("frame").get<double>();
  key.position = object.get_if<Three>("position");
  key.orientation = object.get_if<std::array<double, 4>>("orientation");
  key.scale = object.get_if<double>("scale");
  return key;
}

ordered_json json_from(const TransformKey& key) {
  ordered_json object{{"frame", key.frame}};
  add_optional(object, "position", key.position);
  add_optional(object, "orientation", key.orientation);
  add_optional(object, "scale", key.scale);
  return object;
}

}  // namespace

Geometry shot_geometry_from(const JsonNode& object) {
  Geometry geometry;
  geometry.file = path_from(object.at("file"));
  if (object.has("material")) geometry.material = material_from(object.at("material"));
  if (object.has("keys")) {
    const JsonNode keys = object.at("keys");
    for (std::size_t i = 0; i < keys.size(); ++i) {
      geometry.keys.push_back(transform_key_from(keys.at(i)));
      if (i == 0 || geometry.keys[i].frame > geometry.keys[i - 1].frame) continue;
      throw keys.at(i).at("frame").input_error(
          fmt::format("found {} after {}", geometry.keys[i].frame, geometry.keys[i - 1].frame),
          "Sort the keys by frame, and keep one key per frame");
    }
  }
  geometry.samples = object.get("samples", geometry.samples);
  return geometry;
}

ordered_json json_from(const Geometry& geometry) {
  ordered_json object{{"file", geometry.file}};
  if (geometry.material) object["material"] = json_from(*geometry.material);
  if (!geometry.keys.empty()) {
    auto& keys = object["keys"] = ordered_json::array();
    for (const TransformKey& key : geometry.keys) keys.push_back(json_from(key));
  }
  object["samples"] = geometry.samples;
  return object;
}

Light shot_light_from(const JsonNode& object) {
  const int kinds = (object.has("ambient") ? 1 : 0) + (object.has("direction") ? 1 : 0) +
                    (object.has("environment") ? 1 : 0) + (object.has("light_field") ? 1 : 0);
  if (kinds != 1) {
    throw object.input_error(
        "found not exactly one of \"ambient\", \"direction\", \"environment\" and \"light_field\"",
        "Give each light exactly one of these properties");
  }
  const auto only = [&](std::initializer_list<const char*> kinds_with,
                        std::initializer_list<const char*> words) {
    for (const char* kind : kinds_with) {
      if (object.has(kind)) return;
    }
    for (const char* word : words) {
      if (!object.has(word)) continue;
      throw object.at(word).input_error(
          fmt::format("only a light with \"{}\" has this",
                      fmt::join(kinds_with.begin(), kinds_with.end(), "\" or \"")),
          "Remove it");
    }
  };
  only({"direction"}, {"color", "shadows"});
  only({"environment"}, {"rotation_deg"});
  only({"environment", "light_field"}, {"strength", "rays"});
  Light light;
  light.ambient = object.get_if<Three>("ambient");
  light.direction = object.get_if<Three>("direction");
  if (light.direction == Three{0, 0, 0}) {
    throw object.at("direction")
        .input_error("found a direction of length 0", "Give the direction of propagation");
  }
  light.color = object.get("color", light.color);
  light.shadows = object.get("shadows", light.shadows);
  if (object.has("environment")) light.environment = path_from(object.at("environment"));
  light.rotation_deg = object.get("rotation_deg", light.rotation_deg);
  light.light_field = object.get("light_field", light.light_field);
  light.strength = object.get("strength", light.strength);
  light.rays = object.get("rays", light.rays);
  return light;
}

ordered_json json_from(const Light& light) {
  if (light.ambient) return {{"ambient", *light.ambient}};
  if (light.direction) {
    return {{"direction", *light.direction}, {"color", light.color}, {"shadows", light.shadows}};
  }
  if (!light.light_field.empty()) {
    return {{"light_field", light.light_field}, {"strength", light.strength}, {"rays", light.rays}};
  }
  return {{"environment", light.environment},
          {"rotation_deg", light.rotation_deg},
          {"strength", light.strength},
          {"rays", light.rays}};
}

}  // namespace raystage
