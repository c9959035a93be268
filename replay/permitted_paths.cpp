// SPDX-License-Identifier: Apache-2.0
#include "replay/permitted_paths.h"

#include <utility>

#include "base/atomic_file.h"
#include "base/error.h"
#include "replay/shot_paths.h"
#include "schemas/shot_document.h"

namespace raystage::replay {

namespace fs = std::filesystem;

void PermittedPaths::permit(std::string_view file, std::string_view text) {
  for (ShotPath& path : shot_paths(text, files_.path(file).parent_path())) {
    try {
      if (files_.contains(path.written) && files_.contains(path.normal)) continue;
    } catch (const Error&) {  // whoever opens it says so
    }
    const std::scoped_lock lock(mutex_);
    permitted_.insert(std::move(path.written));
    permitted_.insert(std::move(path.normal));
  }
}

void PermittedPaths::check(std::string_view file, std::string_view text) {
  const fs::path shot = files_.path(file);
  bool is_read = false;
  for (const ShotPath& path : shot_paths(text, shot.parent_path())) {
    if (is_permitted(path)) continue;
    if (!std::exchange(is_read, true)) permit_file(file, shot);
    if (is_permitted(path)) continue;
    throw Error::bad_input("the shot names a file outside of the viewer's folder",
                           path.normal.string(),
                           "Choose a file below " + files_.folder().string() +
                               ", or name it in the shot's file with an editor");
  }
}

// After a restart of the viewer, pages go on with shots that they do not open again.
void PermittedPaths::permit_file(std::string_view file, const fs::path& shot) {
  if (!file_exists(shot)) return;
  try {
    const std::string saved = files_.read(file);
    schemas::parse_shot(saved, std::string(file));  // no other document permits anything
    permit(file, saved);
  } catch (const Error&) {  // a file that is no shot
  }
}

bool PermittedPaths::is_permitted(const ShotPath& path) const {
  if (files_.contains(path.written) && files_.contains(path.normal)) return true;
  const std::scoped_lock lock(mutex_);
  return permitted_.contains(path.written) ||
         (path.is_unambiguous && permitted_.contains(path.normal));
}

}  // namespace raystage::replay
