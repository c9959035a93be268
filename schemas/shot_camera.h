// SPDX-License-Identifier: Apache-2.0
// Internal to schemas/: the JSON of a shot's camera.
#pragma once

#include "schemas/document.h"
#include "schemas/shot_document.h"

namespace raystage {

/// Reads a camera. `version` is that of the shot's schema; in version 1 a camera is a list of keys.
ShotDocument::Camera shot_camera_from(const JsonNode& camera, int version);
nlohmann::ordered_json json_from(const ShotDocument::Camera& camera);

}  // namespace raystage
