// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

namespace raystage::schemas {

/// The text of schemas/NAME.schema.json when the library was built.
struct EmbeddedSchema {
  std::string_view name;  ///< "rig", "take" ...; an older version has its number: "shot-1"
  std::string_view text;  ///< JSON Schema, draft 2020-12
};

std::span<const EmbeddedSchema> embedded_schemas();

}  // namespace raystage::schemas
