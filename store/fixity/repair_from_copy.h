// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "store/fixity/repair.h"

namespace raystage::store {

/// Another copy of a take, from which repair_take() takes what is damaged or missing. The copy is
/// only read. No links are followed in either folder.
class CopyOfTake {
 public:
  /// Throws Error (bad input) if `copy` is no take, or not a copy of `take`: its name, epoch, or
  /// cameras differ, or both are the same folder.
  CopyOfTake(std::filesystem::path take, std::filesystem::path copy);

  /// Returns whether take.json and rig.json of the take were readable.
  bool has_own_documents() const { return has_own_documents_; }
  /// Restores take.json, rig.json and the recording accounts if they are missing or cannot be read,
  /// and an account that lacks the end of a session which the copy's has.
  std::vector<RepairReport::RestoredFile> restore_documents(bool dry_run) const;
  /// Merges one archive and its journal with those of the copy. Throws Error (bad input) as
  /// merge_pairs(), and if neither of the two archives exists; Error (failed) if a disk fails.
  void repair_camera(ArchivePair pair, bool dry_run, RepairReport::Camera& result) const;
  /// Restores the timeline if it is missing or does not match, and files that are missing. Call it
  /// after the archives are repaired.
  std::vector<RepairReport::RestoredFile> restore_derived(bool dry_run) const;

 private:
  void restore(const std::string& file, bool dry_run,
               std::vector<RepairReport::RestoredFile>& restored,
               const std::function<void(const std::string& bytes)>& check) const;

  std::filesystem::path take_, copy_;
  bool has_own_documents_ = false;
};

}  // namespace raystage::store
