// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/uio.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>

namespace raystage {

struct ContainedPath;

/// Raises the limit of open files to what the system permits this process: archives of all cameras
/// stay open.
void raise_open_file_limit();

/// Owns a file descriptor, negative if open() failed. close() reports the error that the destructor
/// ignores.
class FileDescriptor {
 public:
  explicit FileDescriptor(int number) : number_(number) {}
  ~FileDescriptor();
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;

  bool open() const { return number_ >= 0; }
  int number() const { return number_; }
  /// Returns false and sets errno if that fails.
  bool close();

 private:
  int number_;
};

/// A file that is written at explicit offsets. It is locked while open: no other OutputFile, in
/// this process or another, can open it, if the file system supports locks.
class OutputFile {
 public:
  enum class Open { kNew, kExisting };
  /// Throws Error (failed) if a new file exists already or cannot be created, or if an existing
  /// file cannot be opened or is open for writing elsewhere.
  explicit OutputFile(std::filesystem::path path, Open open = Open::kNew);
  /// Opens an existing file. Throws also if a part of its relative path is a link.
  explicit OutputFile(const ContainedPath& existing);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// Returns whether the file system supports locks, so that no other OutputFile has this file
  /// open.
  bool is_locked() const { return is_locked_; }
  /// Returns false and sets errno if not all bytes could be written.
  [[nodiscard]] bool write_at(std::uint64_t offset, std::span<const std::byte> bytes);
  /// Writes all parts consecutively from `offset`, in one system call if the kernel permits.
  /// Returns false and sets errno if not all bytes could be written.
  [[nodiscard]] bool write_parts_at(std::uint64_t offset,
                                    std::span<const std::span<const std::byte>> parts);
  /// Sets the file's size in bytes. Returns false and sets errno if that fails.
  [[nodiscard]] bool truncate(std::uint64_t size);
  /// Waits until all data written before the call is on disk; another thread may write meanwhile.
  /// Returns false and sets errno if flushing fails.
  [[nodiscard]] bool sync() const;
  /// Drops flushed data from the kernel's page cache, for files not read again soon. A hint.
  void uncache() const;
  /// Closes and removes the file, for example after a failed write.
  void discard();

 private:
  /// Throws Error (failed) if the opened file is not a regular one or is locked.
  void lock();

  std::filesystem::path path_;
  FileDescriptor file_;
  bool is_locked_ = false;
};

/// Reads up to bytes.size() bytes from an offset of a regular file; returns how many there are: 0
/// if the file cannot be read or is not a regular one.
std::size_t read_file_part(const std::filesystem::path& file, std::uint64_t offset,
                           std::span<std::byte> bytes);
std::size_t read_file_part(const ContainedPath& file, std::uint64_t offset,
                           std::span<std::byte> bytes);

/// A regular file that is read at explicit offsets, also while another process writes it.
class InputFile {
 public:
  /// Throws Error (bad input) if the file cannot be read or is not a regular one.
  explicit InputFile(const std::filesystem::path& path);
  explicit InputFile(const ContainedPath& path);

  std::uint64_t size() const { return size_; }  ///< when it was opened
  /// Reads up to bytes.size() bytes from an offset; returns how many there are: fewer at the end of
  /// the file, or where the disk cannot read.
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> bytes) const;
  /// Starts reading a part from disk in the background. A hint.
  void read_ahead(std::uint64_t offset, std::uint64_t size) const;

 private:
  friend class MappedFile;
  void require_regular(const std::filesystem::path& path);

  FileDescriptor file_;
  std::uint64_t size_ = 0;
};

/// Flushes a folder's directory entries to disk, if the file system supports it.
void sync_folder(const std::filesystem::path& folder);

/// Flushes every file below `folder` to disk. Throws Error (failed) if that fails. Writeback of all
/// files starts before it waits for one, so that they share commits: much faster for many files.
void sync_files_below(const std::filesystem::path& folder);

}  // namespace raystage
