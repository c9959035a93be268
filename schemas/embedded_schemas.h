// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

namespace raystage {

/// schemas/NAME.schema.json, as it was when the library was built.
struct EmbeddedSchema {
  /// "rig", "take", "shot", "import", "views", "record", "recording", "bench", "planes"; of an
  /// older version with its number, as "shot-1".
  std::string_view name;
  std::string_view text;  ///< JSON Schema, draft 2020-12
};

std::span<const EmbeddedSchema> embedded_schemas();

}  // namespace raystage
