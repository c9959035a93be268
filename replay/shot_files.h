// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace raystage::replay {

/// The files that a page may read and write: below one folder, by relative paths. A path never
/// leads out of the folder, by ".." or by a link.
class ShotFiles {
 public:
  /// Throws Error (bad input) if `folder` is no folder.
  explicit ShotFiles(const std::filesystem::path& folder);

  const std::filesystem::path& folder() const { return folder_; }
  /// Returns the path of a file. Throws Error (bad input) if it would be outside of the folder.
  std::filesystem::path path(std::string_view file) const;
  /// Returns the text of a shot: at most 4 MB. Throws Error (bad input).
  std::string read(std::string_view file) const;
  /// Writes a shot atomically. `text`: kept as it is, with remarks and what the viewer does not
  /// know. Throws Error (bad input) if it is no valid shot, or if the file exists and `replace` is
  /// false; Error (failed) if it cannot be written.
  void write(std::string_view file, std::string_view text, bool replace) const;

 private:
  std::filesystem::path folder_;  ///< without links
};

}  // namespace raystage::replay
