// SPDX-License-Identifier: Apache-2.0
#include "replay/shot_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <system_error>

#include "base/atomic_file.h"
#include "base/error.h"
#include "schemas/shot_document.h"

namespace raystage::replay {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kMaxShotBytes = 4'000'000;

bool is_below(const fs::path& path, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first ==
         folder.end();
}

}  // namespace

ShotFiles::ShotFiles(const fs::path& folder) {
  std::error_code error;
  folder_ = fs::canonical(folder, error);
  if (error || !fs::is_directory(folder_)) {
    throw Error::bad_input("this is no folder", folder.string(), "Give the folder for shots");
  }
}

fs::path ShotFiles::path(std::string_view file) const {
  const fs::path relative(file);
  std::error_code error;
  // Resolves the links of the part that exists.
  const fs::path resolved = fs::weakly_canonical(folder_ / relative, error);
  if (file.empty() || relative.is_absolute() || error || !is_below(resolved, folder_) ||
      resolved == folder_) {
    throw Error::bad_input("the file is outside of the viewer's folder", std::string(file),
                           "Give a path below " + folder_.string());
  }
  return resolved;
}

std::string ShotFiles::read(std::string_view file) const {
  const fs::path from = path(file);
  std::error_code error;
  if (!fs::is_regular_file(from, error) || fs::file_size(from, error) > kMaxShotBytes || error) {
    throw Error::bad_input("this is no shot file", from.string(),
                           "Choose a .json file of at most 4 MB");
  }
  return read_file(from);
}

void ShotFiles::write(std::string_view file, std::string_view text, bool replace) const {
  const fs::path to = path(file);
  if (to.extension() != ".json") {
    throw Error::bad_input("a shot's file ends in .json", to.string(), "Add .json to its name");
  }
  schemas::parse_shot(text, to.string());
  if (file_exists(to)) {
    if (!replace) {
      throw Error::bad_input("the file exists", to.string(),
                             "Confirm to replace it, or choose another name");
    }
    // Only a shot is replaced, whatever the request says: not take.json or rig.json.
    schemas::parse_shot(read(file), to.string());
  }
  write_file_atomically(to, text);
}

}  // namespace raystage::replay
