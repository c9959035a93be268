// SPDX-License-Identifier: Apache-2.0
#include "replay/shot_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <system_error>

#include "base/atomic_file.h"
#include "base/error.h"
#include "replay/shot_paths.h"
#include "schemas/shot_document.h"
#include "schemas/shot_notes.h"

namespace raystage::replay {
namespace {

namespace fs = std::filesystem;

bool is_below(const fs::path& path, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first ==
         folder.end();
}

/// Returns the text of a file; empty if there is none, or it is too large for a shot.
std::string read_if_present(const fs::path& file) {
  std::error_code error;
  if (!fs::is_regular_file(file, error) || fs::file_size(file, error) > kMaxShotBytes || error) {
    return {};
  }
  return read_file(file);
}

}  // namespace

ShotFiles::ShotFiles(const fs::path& folder) {
  std::error_code error;
  folder_ = fs::canonical(folder, error);
  if (error || !is_folder(folder_)) {
    throw Error::bad_input("this is no folder", folder.string(), "Give the folder for shots");
  }
}

bool ShotFiles::contains(const fs::path& path) const {
  std::error_code error;
  const fs::path resolved = fs::weakly_canonical(path, error);
  if (error) {
    throw Error::bad_input("the path cannot be examined: " + error.message(), path.string(),
                           "Choose another file");
  }
  return is_below(resolved, folder_);
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

fs::path ShotFiles::folder_path(std::string_view folder) const {
  return folder == "." ? folder_ : path(folder);
}

fs::path ShotFiles::writable_path(std::string_view file) const {
  fs::path resolved = path(file);
  for (fs::path folder = resolved;; folder = folder.parent_path()) {
    if (file_exists(folder / "take.json")) {
      throw Error::bad_input("the file would be inside of a take, which the viewer never changes",
                             std::string(file), "Choose a folder that is not a take");
    }
    if (folder == folder_) break;
  }
  return resolved;
}

std::string ShotFiles::read(std::string_view file) const {
  const fs::path from = path(file);
  std::error_code error;
  if (!fs::exists(from, error)) {
    throw Error::bad_input("there is no such file", from.string(), "Choose an existing .json file");
  }
  if (!fs::is_regular_file(from, error) || fs::file_size(from, error) > kMaxShotBytes || error) {
    throw Error::bad_input("this is no shot file", from.string(),
                           "Choose a .json file of at most 4 MB");
  }
  return read_file(from);
}

std::string ShotFiles::write(std::string_view file, std::string_view text, bool replace,
                             std::string_view from_shot) const {
  const fs::path to = writable_path(file);
  if (to.extension() != ".json" || to.filename() == "take.json") {
    throw Error::bad_input("a shot's file ends in .json, and is not called take.json", to.string(),
                           "Choose another name");
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
  std::string written(text);
  if (!from_shot.empty()) {
    const fs::path from = path(from_shot).parent_path();
    if (from != to.parent_path()) written = rebase_shot_paths(text, from, to.parent_path());
  }
  write_file_atomically(to, std::string_view(written));
  return written;
}

std::string ShotFiles::read_notes(std::string_view shot_file) const {
  std::string text = read_if_present(beside(shot_file, ".notes.json"));
  if (!text.empty()) schemas::parse_shot_notes(text, std::string(shot_file));
  return text;
}

bool ShotFiles::write_notes(std::string_view shot_file, std::string_view text,
                            std::string_view previous) const {
  schemas::parse_shot_notes(text, "notes");
  writable_path(shot_file);
  // A file that cannot be read is not replaced. Notes are only written by one thread.
  if (read_notes(shot_file) != previous) return false;
  write_file_atomically(beside(shot_file, ".notes.json"), text);
  return true;
}

std::string ShotFiles::read_autosave(std::string_view shot_file) const {
  const fs::path kept = beside(shot_file, ".autosave.json"), saved = path(shot_file);
  std::error_code error;
  if (file_exists(saved) && fs::last_write_time(kept, error) < fs::last_write_time(saved, error)) {
    return {};
  }
  return read_if_present(kept);
}

void ShotFiles::write_autosave(std::string_view shot_file, std::string_view text) const {
  schemas::parse_shot(text, std::string(shot_file));
  writable_path(shot_file);
  write_file_atomically(beside(shot_file, ".autosave.json"), text);
}

void ShotFiles::forget_autosave(std::string_view shot_file) const {
  writable_path(shot_file);
  std::error_code error;  // it may be gone, or never have been
  fs::remove(beside(shot_file, ".autosave.json"), error);
}

fs::path ShotFiles::beside(std::string_view shot_file, std::string_view extension) const {
  const fs::path shot = path(shot_file);
  fs::path file = shot.parent_path() / fs::path(shot_file).filename();
  std::error_code error;
  if (!file.has_filename() || file.filename() == "." || file.filename() == ".." ||
      fs::is_symlink(file.replace_extension(extension), error)) {
    throw Error::bad_input("this is no name of a shot, or a link is in the place of its notes",
                           std::string(shot_file), "Choose another name");
  }
  return file;
}

}  // namespace raystage::replay
