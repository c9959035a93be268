// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

namespace raystage {

/// The text of schemas/NAME.schema.json when the library was built.
struct EmbeddedSchema {
  /// "rig", "take", "shot", "import", "views", "record", "recording", "bench", "planes"; an
  /// older version has its number appended: "shot-1".
  std::string_view name;
  std::string_view text;  ///< JSON Schema, draft 2020-12
};

std::span<const EmbeddedSchema> embedded_schemas();

}  // namespace raystage
