// SPDX-License-Identifier: Apache-2.0
#include "replay/permitted_paths.h"

#include "base/atomic_file.h"
#include "base/error.h"
#include "replay/shot_paths.h"

namespace raystage::replay {

namespace fs = std::filesystem;

void PermittedPaths::permit(std::string_view file, std::string_view text) {
  for (fs::path& path : shot_paths(text, files_.path(file).parent_path())) {
    const std::scoped_lock lock(mutex_);
    permitted_.insert(std::move(path));
  }
}

void PermittedPaths::check(std::string_view file, std::string_view text) {
  const fs::path shot = files_.path(file);
  bool is_read = false;
  for (const fs::path& path : shot_paths(text, shot.parent_path())) {
    if (is_permitted(path)) continue;
    // After a restart of the viewer, pages go on with shots that they do not open again.
    if (!is_read && file_exists(shot)) permit(file, files_.read(file));
    is_read = true;
    if (is_permitted(path)) continue;
    throw Error::bad_input("the shot names a file outside of the viewer's folder", path.string(),
                           "Choose a file below " + files_.folder().string() +
                               ", or name it in the shot's file with an editor");
  }
}

bool PermittedPaths::is_permitted(const fs::path& path) const {
  if (files_.contains(path)) return true;
  const std::scoped_lock lock(mutex_);
  return permitted_.contains(path);
}

}  // namespace raystage::replay
