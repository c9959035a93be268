# SPDX-License-Identifier: Apache-2.0
# Writes OUTPUT, a .cpp file with the text of each file of FILES (separated by ',') in SOURCE_DIR, so that the
# program serves its pages without reading files at run time.
string(REPLACE "," ";" FILES "${FILES}")
set(types_html "text/html; charset=utf-8")
set(types_css "text/css; charset=utf-8")
set(types_js "text/javascript; charset=utf-8")
set(types_svg "image/svg+xml")
set(entries "")
foreach(name IN LISTS FILES)
  file(READ "${SOURCE_DIR}/${name}" text)
  string(REGEX REPLACE ".*\\." "" extension "${name}")
  string(APPEND entries "    {\"${name}\", \"${types_${extension}}\", R\"WEB_FILE(${text})WEB_FILE\"},\n")
endforeach()
# Unchanged contents keep their time stamp: nothing is compiled again.
file(WRITE "${OUTPUT}.new" "// SPDX-License-Identifier: Apache-2.0
// Generated from replay/web/ by embed_files.cmake.
#include \"replay/embedded_files.h\"

namespace raystage::replay {
namespace {

constexpr EmbeddedFile kFiles[] = {
${entries}};

}  // namespace

std::span<const EmbeddedFile> embedded_files() { return kFiles; }

}  // namespace raystage::replay
")
file(COPY_FILE "${OUTPUT}.new" "${OUTPUT}" ONLY_IF_DIFFERENT)
file(REMOVE "${OUTPUT}.new")
