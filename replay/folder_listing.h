// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/time.h"
#include "store/jpeg/rgb_image.h"

namespace raystage::replay {

/// A take, a shot or a folder in a folder.
struct FolderEntry {
  enum class Kind { kTake, kShot, kFolder } kind = Kind::kFolder;
  std::string name;     ///< of the file or folder
  std::string title;    ///< of the take or shot; may be empty
  std::string problem;  ///< why it cannot be opened; empty if it can
  // Of takes.
  int cameras = 0;
  double seconds = 0;            ///< from the first to the last frame of the first camera
  std::uint64_t bytes = 0;       ///< of all archives
  Nanoseconds recorded_utc = 0;  ///< of the take's time 0; 0: unknown
  bool is_recording = false;     ///< a recorder writes it, or was killed
  /// When a report of `raystage verify` was written beside the take, NAME.verify.json, and whether
  /// it found no problem; none: never.
  std::optional<Nanoseconds> verified_utc;
  bool is_intact = false;
};

/// Returns the takes, shots and folders of a folder, by name; at most 2000. Only documents and the
/// ends of journals are read. Links are not followed. Throws Error (bad input) if it is no folder.
std::vector<FolderEntry> list_folder(const std::filesystem::path& folder);

/// Returns a picture of a take, to fit into a size: a frame of the camera in the middle of the
/// array, from the middle of the take. Throws Error (bad input) if it has none.
store::RgbImage take_thumbnail(const std::filesystem::path& take, int width, int height);

}  // namespace raystage::replay
