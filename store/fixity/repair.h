// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/run_status.h"
#include "store/fixity/salvage.h"
#include "store/take.h"

namespace raystage::store {

struct RepairOptions {
  bool dry_run = false;  ///< report what would be done, change nothing
  /// Folder of another copy of the take, which is only read: what is damaged or missing is taken
  /// from it.
  std::optional<std::filesystem::path> copy = {};
  /// Called with the share of cameras done, 0 to 1, from any thread.
  std::function<void(double)> progress = {};
  std::stop_token stop = {};  ///< checked between cameras, and in files of a copy
};

/// The repairs of a take, done or (dry_run) planned.
struct RepairReport {
  struct Camera {
    std::string id;
    bool was_intact = false;  ///< nothing was to be done
    bool repaired = false;    ///< false with dry_run
    SalvageResult salvage;    ///< empty if it was intact; with a copy: only frames and losses
    std::int64_t frames_from_copy = 0;
    /// New names of the originals; empty if nothing was lost or in doubt.
    std::vector<std::string> kept;
    std::string error;  ///< why it cannot be repaired; empty if it can
  };
  std::vector<Camera> cameras;
  /// A file other than an archive or a journal that is taken from the copy.
  struct RestoredFile {
    std::string path;   ///< relative to the take
    std::string error;  ///< why it cannot be taken; empty if it can
  };
  std::vector<RestoredFile> files;
  /// What else is in the copy and was not taken: links, special files, names of no take's file.
  std::vector<Error> left_out;
  /// Whether the timeline has kept its ticks, and lost frames are absent from it now.
  bool is_timeline_renumbered = false;
  /// New name of a timeline that no longer matches; empty if it matches, or with dry_run.
  std::string renamed_timeline;
  RunStatus status = RunStatus::kNotRun;

  bool has_losses() const;
  bool failed() const;  ///< some camera or file has an error
};

/// Writes each damaged archive and journal of a take anew from what can be saved of them. Each pair
/// is written next to the originals under temporary names, verified, synced to the disk and renamed
/// over them. Originals with lost or unverified contents are kept as CAMERA.mkv.damaged and
/// CAMERA.journal.damaged. Repairs as many cameras at once as TBB has threads, and needs free space
/// for that many of the largest damaged archives.
///
/// With a copy, frames and records that are damaged or missing are taken from it (merge_pairs.h),
/// and so are missing files, and documents that cannot be read. Nothing in the copy is changed.
///
/// Throws Error (bad input) if take.json or rig.json cannot be read, or the copy is of another
/// take.
RepairReport repair_take(const std::filesystem::path& folder, const RepairOptions& options);

/// Writes the frames and records of `salvaged` as a new pair of closed files. Throws Error (failed)
/// if the disk fails.
void write_salvaged_archive(const ArchivePair& pair, const SalvageResult& salvaged,
                            const std::filesystem::path& archive,
                            const std::filesystem::path& journal);

}  // namespace raystage::store
