// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace raystage::replay {

/// Larger files are not read as shots.
inline constexpr std::uintmax_t kMaxShotBytes = 4'000'000;

/// The files that a page may read and write: below one folder, by relative paths. A path never
/// leads out of the folder, by ".." or by a link.
class ShotFiles {
 public:
  /// Throws Error (bad input) if `folder` is no folder.
  explicit ShotFiles(const std::filesystem::path& folder);

  const std::filesystem::path& folder() const { return folder_; }
  /// Returns whether an absolute path is the folder or below it, links resolved. Throws Error (bad
  /// input) if that cannot be determined.
  bool contains(const std::filesystem::path& path) const;
  /// Returns the path of a file. Throws Error (bad input) if it would be outside of the folder.
  std::filesystem::path path(std::string_view file) const;
  /// Returns the path of a folder; "." is the folder of all. Throws as path().
  std::filesystem::path folder_path(std::string_view folder) const;
  /// Returns the path of a file to write. Throws Error (bad input) also if it would be inside of a
  /// take.
  std::filesystem::path writable_path(std::string_view file) const;
  /// Returns the text of a shot: at most 4 MB. Throws Error (bad input).
  std::string read(std::string_view file) const;
  /// Writes a shot atomically and returns its text. `from_shot`: shot from whose folder the paths
  /// in `text` start; empty: `file`. Where that is another folder, paths are changed. `text`: else
  /// kept as it is, with remarks and what the viewer does not know. Throws Error (bad input) if it
  /// is no valid shot, or if the file exists and `replace` is false; Error (failed) if it cannot be
  /// written.
  std::string write(std::string_view file, std::string_view text, bool replace,
                    std::string_view from_shot = {}) const;

  /// Returns the notes document of a shot, NAME.notes.json in its folder, or an empty text.
  /// Throws Error (bad input) if they are not valid.
  std::string read_notes(std::string_view shot_file) const;
  /// Replaces the notes if they are still `previous`, and returns whether they were: several pages
  /// write notes. Throws Error (bad input) if the old or the new notes are not valid.
  bool write_notes(std::string_view shot_file, std::string_view text,
                   std::string_view previous) const;

  /// Returns the text that was kept for a shot and is newer than its file, NAME.autosave.json;
  /// empty: none.
  std::string read_autosave(std::string_view shot_file) const;
  /// Throws Error (bad input) if `text` is no valid shot.
  void write_autosave(std::string_view shot_file, std::string_view text) const;
  void forget_autosave(std::string_view shot_file) const;

 private:
  /// Returns NAME and the extension, in the folder of a shot.
  std::filesystem::path beside(std::string_view shot_file, std::string_view extension) const;

  std::filesystem::path folder_;  ///< without links
};

}  // namespace raystage::replay
