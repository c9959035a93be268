// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/posix_file.h"
#include "schemas/imported_depths_document.h"
#include "store/take.h"

namespace raystage::depths {

/// Lets one import at a time change the imported depths of a take: from reading the list of maps to
/// replacing it, so that none loses the maps of another. The lock (flock) is on the folder itself
/// and ends with the process; there is no file that could be left behind or copied.
class ImportLock {
 public:
  /// Creates the folder of imported depths. Throws Error (failed) if another import holds the lock,
  /// or the folder cannot be created or opened; Error (bad input) if it is a link.
  explicit ImportLock(const store::Take& take);

  /// Removes the maps of imports that were killed: those in the cameras' folders that the list does
  /// not name. Other files, links and what cannot be removed remain. Does nothing on file systems
  /// without locks, where the maps may be those of a running import.
  void remove_unlisted(const store::Take& take,
                       const schemas::ImportedDepthsDocument& document) const;

 private:
  FileDescriptor folder_;
  bool is_locked_ = false;
};

}  // namespace raystage::depths
