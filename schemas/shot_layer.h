// SPDX-License-Identifier: Apache-2.0
// Internal to schemas/: the JSON of a shot's layer.
#pragma once

#include "schemas/document.h"
#include "schemas/shot_document.h"

namespace raystage {

ShotDocument::Layer shot_layer_from(const JsonNode& object);
nlohmann::ordered_json json_from(const ShotDocument::Layer& layer);

}  // namespace raystage
