// SPDX-License-Identifier: Apache-2.0
#include "store/fixity/restorable_depths.h"

#include <set>

#include "base/contained_path.h"
#include "base/error.h"
#include "schemas/imported_depths_document.h"
#include "store/imported_depths.h"

namespace raystage::store {

namespace fs = std::filesystem;
using schemas::ImportedDepthsDocument;

bool is_damaged_map(const std::string& file, const fs::path& take, const fs::path& copy) {
  if (!file.starts_with(ImportedDepthsDocument::kFolder) || !file.ends_with(".zst")) return false;
  if (!is_contained({take, file})) return false;  // behind a link nothing is written
  const auto is_intact = [&](const fs::path& folder) {
    try {
      return has_stated_hash({folder, file});
    } catch (const Error&) {
      return false;
    }
  };
  return !is_intact(take) && is_intact(copy);
}

void check_list_of_maps(const fs::path& take, const std::string& text) {
  const ImportedDepthsDocument list =
      schemas::parse_imported_depths(text, ImportedDepthsDocument::kFile);
  std::set<std::string> named;
  for (const ImportedDepthsDocument::Camera& camera : list.cameras) {
    for (const ImportedDepthsDocument::Map& map : camera.maps) named.insert(map.file);
  }
  for (const ContainedPath& file : imported_map_files(Take(take))) {
    const fs::path name = file.relative.lexically_relative(ImportedDepthsDocument::kFolder);
    if (name.filename().string().starts_with(".") || named.contains(name.string())) continue;
    throw Error::bad_input(
        "the copy's list lacks depth maps that are here, such as " + name.string(),
        (take / ImportedDepthsDocument::kFile).string(), "Use a copy that has the whole list");
  }
}

}  // namespace raystage::store
