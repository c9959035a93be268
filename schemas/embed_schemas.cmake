# SPDX-License-Identifier: Apache-2.0
# Writes OUTPUT, a .cpp file with the text of SOURCE_DIR/NAME.schema.json for each NAME of NAMES
# (separated by ','), so that programs do not read schemas at run time.
string(REPLACE "," ";" NAMES "${NAMES}")
set(entries "")
foreach(name IN LISTS NAMES)
  file(READ "${SOURCE_DIR}/${name}.schema.json" text)
  string(APPEND entries "    {\"${name}\", R\"SCHEMA(${text})SCHEMA\"},\n")
endforeach()
file(WRITE "${OUTPUT}" "// SPDX-License-Identifier: Apache-2.0
// Generated from schemas/*.schema.json by embed_schemas.cmake.
#include \"schemas/embedded_schemas.h\"

namespace raystage::schemas {
namespace {

constexpr EmbeddedSchema kSchemas[] = {
${entries}};

}  // namespace

std::span<const EmbeddedSchema> embedded_schemas() { return kSchemas; }

}  // namespace raystage::schemas
")
