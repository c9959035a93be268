// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <mutex>
#include <set>
#include <string_view>

#include "replay/shot_files.h"
#include "replay/shot_paths.h"

namespace raystage::replay {

/// What the shots that a page sends may name: files below the viewer's folder, and those outside
/// that shots of this folder name already, because the user has put them there. Otherwise a page
/// could look at all files of the user. May be used by several threads.
class PermittedPaths {
 public:
  /// `files` must live as long as this.
  explicit PermittedPaths(const ShotFiles& files) : files_(files) {}

  /// Permits what a shot names whose text is from its file.
  void permit(std::string_view file, std::string_view text);
  /// Throws Error (bad input) that names the first path in the text of a page that is not
  /// permitted or cannot be examined. `file`: the shot from whose folder relative paths start.
  void check(std::string_view file, std::string_view text);

 private:
  void permit_file(std::string_view file, const std::filesystem::path& shot);
  bool is_permitted(const ShotPath& path) const;

  const ShotFiles& files_;
  mutable std::mutex mutex_;                   // guards permitted_
  std::set<std::filesystem::path> permitted_;  ///< outside of the folder, in both forms
};

}  // namespace raystage::replay
