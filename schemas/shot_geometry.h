// SPDX-License-Identifier: Apache-2.0
// Internal to schemas/: the JSON of a shot's geometry and lights.
#pragma once

#include "schemas/document.h"
#include "schemas/shot_document.h"

namespace raystage {

ShotDocument::Geometry shot_geometry_from(const JsonNode& object);
nlohmann::ordered_json json_from(const ShotDocument::Geometry& geometry);

ShotDocument::Light shot_light_from(const JsonNode& object);
nlohmann::ordered_json json_from(const ShotDocument::Light& light);

}  // namespace raystage
