// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/uio.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>

namespace raystage {

/// A file that is written at stated offsets. While it is open no other OutputFile takes it, in this
/// process or another, where the file system knows locks.
class OutputFile {
 public:
  enum class Open { kNew, kExisting };
  /// Throws Error (failed) when a new one exists already or cannot be created, or when an existing
  /// one cannot be opened or is open for writing elsewhere.
  explicit OutputFile(std::filesystem::path path, Open open = Open::kNew);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// False, with errno, when not everything could be written.
  [[nodiscard]] bool write_at(std::uint64_t offset, std::span<const std::byte> bytes);
  /// Writes all parts one after the other from `offset`, in one system call where the kernel lets
  /// it. False, with errno, when not everything could be written.
  [[nodiscard]] bool write_parts_at(std::uint64_t offset,
                                    std::span<const std::span<const std::byte>> parts);
  [[nodiscard]] bool truncate(std::uint64_t size);
  /// Waits until the disk has what was written before the call; another thread may be writing
  /// meanwhile. False, with errno, when the disk refuses.
  [[nodiscard]] bool sync() const;
  /// Takes what the disk has out of the kernel's cache: nobody will read it soon. A hint.
  void uncache() const;
  /// Closes and removes the file; for what failed half way.
  void discard();

 private:
  std::filesystem::path path_;
  int descriptor_ = -1;
};

/// A whole file mapped for reading. A file that another process cuts while it is mapped ends this
/// process with SIGBUS when the lost part is touched: archives only ever grow while they are read.
class MappedFile {
 public:
  /// Throws Error (bad input) when it cannot be read.
  explicit MappedFile(const std::filesystem::path& path);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  std::span<const std::byte> bytes() const { return bytes_; }
  /// Says how the file will be read: from end to end, or a few bytes here and there. A hint.
  enum class Access { kSequential, kSparse };
  void expect(Access access) const;
  /// Asks for a part of bytes() to be read from the disk while the caller goes on. A hint.
  void read_ahead(std::span<const std::byte> part) const;
  /// Brings a part of bytes() into memory. False where that fails, because the disk cannot read it
  /// or the file was cut: touching it would end the process.
  bool can_read(std::span<const std::byte> part) const;

 private:
  std::span<const std::byte> bytes_;
};

/// Brings a folder's list of files to the disk; where the file system can.
void sync_folder(const std::filesystem::path& folder);

/// Brings every file below `folder` to the disk. All are set off first, so that they share the file
/// system's commits: for many files far cheaper than one after the other. Throws Error (failed)
/// when the disk refuses.
void sync_files_below(const std::filesystem::path& folder);

}  // namespace raystage
