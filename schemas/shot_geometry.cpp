// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "schemas/fields.h"
#include "schemas/shot.h"

namespace raystage::schemas {
namespace {

using Geometry = ShotDocument::Geometry;
using Light = ShotDocument::Light;
using Material = ShotDocument::Material;
using TransformKey = ShotDocument::TransformKey;
using Three = std::array<double, 3>;

bool is_glossy(const Material& material) { return material.kind == "glossy"; }

void check_roughness(const JsonNode& object, const Material& material) {
  if (!object.has("roughness") || is_glossy(material)) return;
  throw object.at("roughness")
      .input_error("only glossy materials have this property",
                   "Remove it, or write \"kind\": \"glossy\"");
}

constexpr Fields kMaterial(defaulted("kind", &Material::kind), optional("color", &Material::color),
                           optional("texture", &Material::texture, kPath),
                           written_if(is_glossy, defaulted("roughness", &Material::roughness)),
                           check(check_roughness));

void check_transform_frames(const JsonNode& key, const std::vector<TransformKey>& keys) {
  if (keys.size() < 2 || keys.back().frame > keys[keys.size() - 2].frame) return;
  throw key.at("frame").input_error(fmt::format("found {} after {}, allowed: increasing frames",
                                                keys.back().frame, keys[keys.size() - 2].frame),
                                    "Sort the keys by frame, and keep one key per frame");
}

constexpr Fields kTransformKey(required("frame", &TransformKey::frame),
                               optional("position", &TransformKey::position),
                               optional("orientation", &TransformKey::orientation),
                               optional("scale", &TransformKey::scale));

constexpr Fields kGeometry(
    required("file", &Geometry::file, kPath), optional("material", &Geometry::material, kMaterial),
    optional("keys", &Geometry::keys, list_of(kTransformKey, check_transform_frames)),
    defaulted("animated", &Geometry::is_animated), optional("fps", &Geometry::fps, kFrameRateValue),
    defaulted("frame_offset", &Geometry::frame_offset),
    defaulted("file_unit", &Geometry::applies_unit), defaulted("samples", &Geometry::samples));

/// Rejects properties that have no effect on this kind of light.
void check_kind(const JsonNode& object, const Light&) {
  const auto only = [&](std::initializer_list<const char*> kinds_with,
                        std::initializer_list<const char*> keys) {
    for (const char* kind : kinds_with) {
      if (object.has(kind)) return;
    }
    reject_keys(object, keys,
                fmt::format("only a light with \"{}\" has this property",
                            fmt::join(kinds_with.begin(), kinds_with.end(), "\" or \"")),
                "Remove it");
  };
  only({"direction", "position"}, {"color", "shadows"});
  only({"direction"}, {"angle_deg"});
  only({"position"}, {"radius_m"});
  only({"environment"}, {"rotation_deg"});
  only({"environment", "light_field"}, {"strength", "rays"});
}

void check_direction(const JsonNode& object, const Light& light) {
  if (light.direction != Three{0, 0, 0}) return;
  throw object.at("direction")
      .input_error("found a direction of length 0", "Give the light's direction of propagation");
}

bool is_directional(const Light& light) { return light.direction.has_value(); }
bool is_environment(const Light& light) { return !light.environment.empty(); }
bool is_sphere(const Light& light) { return light.position.has_value(); }
bool is_direct(const Light& light) { return light.direction || light.position; }
bool gathers_light(const Light& light) { return !light.ambient && !is_direct(light); }

constexpr Fields kLight(
    exactly_one_of("\"ambient\", \"direction\", \"position\", \"environment\", \"light_field\"",
                   "Give each light exactly one of these properties", "ambient", "direction",
                   "position", "environment", "light_field"),
    check(check_kind), optional("ambient", &Light::ambient),
    optional("direction", &Light::direction), check(check_direction),
    written_if(is_directional, defaulted("angle_deg", &Light::angle_deg)),
    optional("position", &Light::position),
    written_if(is_sphere, defaulted("radius_m", &Light::radius_m)),
    written_if(is_direct, defaulted("color", &Light::color), defaulted("shadows", &Light::shadows)),
    optional("environment", &Light::environment, kPath),
    written_if(is_environment, defaulted("rotation_deg", &Light::rotation_deg)),
    optional("light_field", &Light::light_field),
    written_if(gathers_light, defaulted("strength", &Light::strength),
               defaulted("rays", &Light::rays)));

}  // namespace

Geometry shot_geometry_from(const JsonNode& object) { return kGeometry.make<Geometry>(object); }

nlohmann::ordered_json json_from(const Geometry& geometry) { return kGeometry.write(geometry); }

Light shot_light_from(const JsonNode& object) { return kLight.make<Light>(object); }

nlohmann::ordered_json json_from(const Light& light) { return kLight.write(light); }

}  // namespace raystage::schemas
