# SPDX-License-Identifier: Apache-2.0
# Writes OUTPUT, a .cpp with the text of the schemas NAME.schema.json in SOURCE_DIR for each NAME of
# NAMES (separated by ','), so that programs need no path at run time.
string(REPLACE "," ";" NAMES "${NAMES}")
set(entries "")
foreach(name IN LISTS NAMES)
  file(READ "${SOURCE_DIR}/${name}.schema.json" text)
  string(APPEND entries "    {\"${name}\", R\"SCHEMA(${text})SCHEMA\"},\n")
endforeach()
file(WRITE "${OUTPUT}" "// SPDX-License-Identifier: Apache-2.0
// Made of schemas/*.schema.json by embed_schemas.cmake.
#include \"schemas/embedded_schemas.h\"

namespace raystage {
namespace {

constexpr EmbeddedSchema kSchemas[] = {
${entries}};

}  // namespace

std::span<const EmbeddedSchema> embedded_schemas() { return kSchemas; }

}  // namespace raystage
")
