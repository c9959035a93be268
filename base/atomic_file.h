// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace raystage {

struct ContainedPath;

/// A hidden file in the target's folder that commit() renames to the target. Without commit(), the
/// destructor removes it. Its name is .NAME.HOST.PID.RANDOM.tmp.EXT; 64 random bits make it unique
/// even if host names or process IDs repeat. If two hosts write one target at once, the target is
/// the complete file of one of them.
class TemporaryFile {
 public:
  enum class Creation {
    kByConstructor,  ///< the constructor creates an empty file, mode 0666 minus the umask
    kByWriter,       ///< the writer creates the file, with O_EXCL
  };
  /// Throws Error (failed) if the file cannot be created.
  explicit TemporaryFile(std::filesystem::path target,
                         Creation creation = Creation::kByConstructor);
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// Flushes the file to disk and renames it to the target. Throws Error (failed) if either fails;
  /// no temporary file remains then.
  void commit();

 private:
  std::filesystem::path target_, path_;
  bool committed_ = false;
};

/// Whose temporary files are abandoned. kEnded: of processes of this host that have ended. kAll: of
/// every process; the caller then holds a lock that every writer of the target holds, so that no
/// such process lives. It also finds files of a process whose ID is in use again, and of other
/// hosts.
enum class Owners { kEnded, kAll };

/// Removes the temporary files of a target that processes left behind when they were killed.
void remove_abandoned_temporary_files(const std::filesystem::path& target,
                                      Owners owners = Owners::kEnded);

/// Throws Error (failed) if write_file_atomically() could not start to write `target`. Call it
/// before a long computation whose result goes there. It leaves no file behind.
void check_writable(const std::filesystem::path& target);

/// Writes a complete file and then renames it to the target. Until it is complete it has no name
/// (O_TMPFILE), or a temporary one where the file system does not support that: a process that is
/// killed leaves nothing behind then. Throws Error (failed) if the disk
/// is full, or if permission or the folder is missing. It does so, too, if the target is not a
/// regular file: a device would be replaced. An existing file is unchanged then.
void write_file_atomically(const std::filesystem::path& target, std::span<const std::byte> bytes);
void write_file_atomically(const std::filesystem::path& target, std::string_view text);

/// Largest file that read_file() accepts by default, and largest scene (GLB's own limit), bytes.
inline constexpr std::uint64_t kMaxFileBytes = std::uint64_t{1} << 30;
inline constexpr std::uint64_t kMaxSceneBytes = std::uint64_t{4} << 30;

/// Returns the contents of a file. Throws Error (bad input) if it cannot be read, is larger than
/// `max_bytes`, or is a device. A pipe is read until its end; one that is silent for 10 s is an
/// error.
std::string read_file(const std::filesystem::path& file, std::uint64_t max_bytes = kMaxFileBytes);
/// Returns the contents of a file in a folder that somebody else may have made. Throws Error (bad
/// input) also if it is not a regular file, and behind links unless they are permitted.
std::string read_file(const ContainedPath& file, std::uint64_t max_bytes = kMaxFileBytes);

/// Returns whether a file or folder exists and can be seen.
bool file_exists(const std::filesystem::path& path);
/// Returns whether a folder, or a link to one, can be seen.
bool is_folder(const std::filesystem::path& path);
/// Returns whether a file, a folder or a link of this name can be seen.
bool is_name_taken(const std::filesystem::path& path);

/// Creates the folder and its parents. Throws Error (failed) if that is not possible.
void create_folder(const std::filesystem::path& folder);

}  // namespace raystage
