// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/error.h"
#include "store/fixity/manifest.h"
#include "store/fixity/repair.h"

namespace raystage::store {

/// Another copy of a take, from which repair_take() takes what is damaged or missing. The copy is
/// only read. No links are followed in either folder.
class CopyOfTake {
 public:
  /// Throws Error (bad input) if `copy` is no take, or not a copy of `take`: its name, epoch, or
  /// cameras differ, or both are the same folder, or a document of the take cannot be opened:
  /// whether its contents are valid is then unknown.
  CopyOfTake(std::filesystem::path take, std::filesystem::path copy, std::stop_token stop);

  /// Returns what is in the copy and is no file of a take.
  const std::vector<Error>& left_out() const { return copied_files_.refused; }
  /// Returns whether take.json and rig.json of the take were readable.
  bool has_own_documents() const { return has_own_documents_; }
  /// Restores take.json, rig.json and the recording accounts if they are missing or their contents
  /// are not valid; these are kept as FILE.damaged. Also restores an account that lacks the end of
  /// a session which the copy's has.
  std::vector<RepairReport::RestoredFile> restore_documents(bool dry_run) const;
  /// Merges one archive and its journal with those of the copy. Throws Error (bad input) as
  /// merge_pairs(), and if neither of the two archives exists; Error (failed) if a disk fails.
  void repair_camera(const ArchivePair& pair, bool dry_run, RepairReport::Camera& result) const;
  /// Restores the timeline if it is missing or does not match, and files that are missing. Call it
  /// after the archives are repaired.
  std::vector<RepairReport::RestoredFile> restore_derived(bool dry_run) const;

 private:
  using Check = std::function<void(const std::string& bytes)>;
  /// Restores a file. `keep_old`: keep what is there as FILE.damaged. `check`: throws Error if the
  /// copy's file is not valid; null for files of any size, which are not loaded whole.
  void restore(const std::string& file, bool dry_run, bool keep_old,
               std::vector<RepairReport::RestoredFile>& restored, const Check& check) const;

  std::filesystem::path take_, copy_;
  std::stop_token stop_;
  bool has_own_documents_ = false;
  FilesOfTake copied_files_;
};

}  // namespace raystage::store
