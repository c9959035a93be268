// SPDX-License-Identifier: Apache-2.0
// Inside schemas/ only: the camera of a shot as it stands in shot.json.
#pragma once

#include "schemas/document.h"
#include "schemas/shot_document.h"

namespace raystage {

/// `version`: of the shot's schema; in version 1 a camera is a list of keys.
ShotDocument::Camera shot_camera_from(const JsonNode& camera, int version);
nlohmann::ordered_json json_from(const ShotDocument::Camera& camera);

}  // namespace raystage
