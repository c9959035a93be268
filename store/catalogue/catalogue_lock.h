// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "base/posix_file.h"

namespace raystage::store {

/// Locks a catalogue for the lifetime of the object. The lock file, .NAME.lock next to the
/// catalogue, stays: removing it would let a third process lock another file of the same name.
class CatalogueLock {
 public:
  /// Throws Error (failed) if another run holds the lock, or if the lock file cannot be created or
  /// opened; the texts differ.
  explicit CatalogueLock(const std::filesystem::path& catalogue);

  /// Returns whether the file system supports locks, so that no other run uses the catalogue.
  bool is_held() const { return is_held_; }

 private:
  FileDescriptor file_;
  bool is_held_ = false;
};

}  // namespace raystage::store
