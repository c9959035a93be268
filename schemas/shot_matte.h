// SPDX-License-Identifier: Apache-2.0
// Internal to schemas/: the JSON of a layer's matte.
#pragma once

#include "schemas/document.h"
#include "schemas/matte_settings.h"

namespace raystage {

MatteSettings matte_settings_from(const JsonNode& object);
nlohmann::ordered_json json_from(const MatteSettings& matte);

}  // namespace raystage
