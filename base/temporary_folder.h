// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include "base/posix_file.h"

namespace raystage {

/// Returns the absolute path with a name and a parent: "out/take/" is "/.../out/take".
std::filesystem::path path_with_name(const std::filesystem::path& folder);

/// A hidden folder next to the target that commit() renames to the target. Without commit(), the
/// destructor removes it. Its name is .NAME.HOST.PID.RANDOM.tmp, and it is locked (flock) while the
/// object lives. What processes of this host that were killed left behind of the same target is
/// removed first: folders of such names whose process has ended and which are not locked.
class TemporaryFolder {
 public:
  /// Throws Error (failed) if the folder cannot be created, by its final name. Parents are created.
  explicit TemporaryFolder(const std::filesystem::path& target);
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  /// As path_with_name() returns it.
  const std::filesystem::path& target() const { return target_; }
  const std::filesystem::path& path() const { return path_; }
  /// Flushes all files to disk and renames the folder, never onto a file or folder. Returns false
  /// and sets errno if it cannot be renamed, EEXIST if the target exists by now; the folder keeps
  /// its hidden name then. Throws Error (failed) if the disk fails.
  [[nodiscard]] bool commit();

 private:
  std::filesystem::path target_, path_;
  std::optional<FileDescriptor> lock_;
  bool committed_ = false;
};

}  // namespace raystage
