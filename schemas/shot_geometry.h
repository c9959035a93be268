// SPDX-License-Identifier: Apache-2.0
// Inside schemas/ only: geometry and lights of a shot as they stand in shot.json.
#pragma once

#include "schemas/document.h"
#include "schemas/shot_document.h"

namespace raystage {

ShotDocument::Geometry shot_geometry_from(const JsonNode& object);
nlohmann::ordered_json json_from(const ShotDocument::Geometry& geometry);

ShotDocument::Light shot_light_from(const JsonNode& object);
nlohmann::ordered_json json_from(const ShotDocument::Light& light);

}  // namespace raystage
