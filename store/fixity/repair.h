// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "store/fixity/salvage.h"
#include "store/take.h"

namespace raystage {

struct RepairOptions {
  bool dry_run = false;  ///< say what would be done, change nothing
  /// Called with the share of cameras done, 0 to 1, from any thread.
  std::function<void(double)> progress;
  std::stop_token stop;  ///< heeded between cameras
};

/// What was done to a take, or would be.
struct RepairReport {
  struct Camera {
    std::string id;
    bool was_whole = false;  ///< nothing to do
    bool repaired = false;   ///< false with dry_run
    Salvage salvage;         ///< empty where it was whole
    /// The originals under their new names; none where nothing was lost or in doubt.
    std::vector<std::string> kept;
    std::string error;  ///< why it cannot be repaired; empty when it can
  };
  std::vector<Camera> cameras;
  /// The new name of a timeline that does not fit; empty where it does, or with dry_run.
  std::string old_timeline;
  bool stopped = false;

  bool lost_anything() const;
  bool failed() const;  ///< some camera has an error
};

/// Writes each damaged archive and journal of a take anew from what can be saved of them. Each pair
/// is written beside the originals under temporary names, verified, brought to the disk and renamed
/// over them. Originals of which anything was lost or is in doubt stay, as CAMERA.mkv.damaged and
/// CAMERA.journal.damaged. Works on as many cameras at once as TBB has threads here, and needs free
/// room for so many of the largest damaged archives.
/// Throws Error (bad input) where take.json or rig.json cannot be read.
RepairReport repair_take(const std::filesystem::path& folder, const RepairOptions& options);

/// Writes what `salvaged` holds as a new pair of closed files. Throws Error (failed) for the disk.
void write_salvaged(const ArchivePair& pair, const Salvage& salvaged,
                    const std::filesystem::path& archive, const std::filesystem::path& journal);

}  // namespace raystage
