// SPDX-License-Identifier: Apache-2.0
// Inside schemas/ only: a layer of a shot as it stands in shot.json.
#pragma once

#include "schemas/document.h"
#include "schemas/shot_document.h"

namespace raystage {

ShotDocument::Layer shot_layer_from(const JsonNode& object);
nlohmann::ordered_json json_from(const ShotDocument::Layer& layer);

}  // namespace raystage
