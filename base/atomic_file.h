// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace raystage {

/// A hidden file in the target's folder that becomes the target when commit() renames it; the
/// destructor removes it otherwise. Its name, .NAME.HOST.PID.RANDOM.tmp.EXT, has 64 random bits, so
/// that no two are alike, whatever hosts and processes are called. Two hosts on one target end in
/// one whole file.
class TemporaryFile {
 public:
  enum class Creation {
    kByConstructor,  ///< the constructor creates the file, empty, with 0666 less the umask
    kByWriter,       ///< whoever writes it creates it, with O_EXCL
  };
  /// Throws Error (failed) where the file cannot be created.
  explicit TemporaryFile(std::filesystem::path target,
                         Creation creation = Creation::kByConstructor);
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// Flushes to disk and renames. Throws Error (failed) when the disk refuses; nothing is left
  /// then.
  void commit();

 private:
  std::filesystem::path target_, path_;
  bool committed_ = false;
};

/// Throws Error (failed) where write_file_atomically() could not begin: to be asked before long
/// work whose result goes there. Leaves nothing.
void check_writable(const std::filesystem::path& target);

/// Writes a whole file under a temporary name and renames it. Throws Error (failed): full disk, no
/// permission, missing folder, a target that is no file (a device would become one); the old file,
/// if any, is untouched then.
void write_file_atomically(const std::filesystem::path& target, std::span<const std::byte> bytes);
void write_file_atomically(const std::filesystem::path& target, std::string_view text);

/// The whole file. Throws Error (bad input) when it cannot be read.
std::string read_file(const std::filesystem::path& file);

/// Creates the folder and its parents. Throws Error (failed) where that is refused.
void create_folder(const std::filesystem::path& folder);

}  // namespace raystage
