// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <utility>

#include "base/mapped_range.h"
#include "base/posix_file.h"

namespace raystage {

/// A complete file mapped for reading. Where another process truncates it, or the disk cannot read
/// it, bytes() are zeros from there on, and check_read() throws.
class MappedFile {
 public:
  /// Throws Error (bad input) if the file cannot be read.
  explicit MappedFile(const std::filesystem::path& path);
  explicit MappedFile(const ContainedPath& path);
  /// Maps the file as large as it was when it was opened. `name`: for errors.
  MappedFile(const InputFile& file, std::filesystem::path name);

  std::span<const std::byte> bytes() const { return pages_.bytes; }
  /// Announces how the file will be read: from start to end, or small parts at random. A hint.
  enum class Access { kSequential, kSparse };
  void expect(Access access) const;
  /// Loads a part of bytes() into memory. Returns false if that fails (disk error, truncated file).
  bool can_read(std::span<const std::byte> part) const;
  /// Returns whether most of bytes() are in the kernel's page cache, by a sample of their pages;
  /// false where the kernel does not say so for files of others. Call it before reading.
  bool is_mostly_cached() const;
  /// Frees the memory of a part of bytes() that is not read again soon, in this process and in the
  /// kernel's page cache. Pages that other processes map stay. A hint.
  void uncache(std::span<const std::byte> part) const;
  /// Throws Error (failed) if some of bytes() are zeros because they could not be read, or if the
  /// file was truncated since it was mapped. Call it after the last access.
  void check_read() const;

 private:
  struct Pages {
    Pages(const FileDescriptor& file, std::uint64_t size, const std::filesystem::path& name);
    ~Pages();
    Pages(const Pages&) = delete;
    Pages& operator=(const Pages&) = delete;
    std::span<const std::byte> bytes;
  };

  std::filesystem::path name_;
  FileDescriptor file_;
  Pages pages_;
  MappedRange range_;  ///< no longer watches when the pages are unmapped
};

/// Returns work(), which reads bytes() of `files`. Throws the Error of check_read() if they were
/// not all read, also where work() fails: the reason is then not what it found in zeros.
template <class Work, class... Files>
auto read_mapped(Work&& work, const Files&... files) {
  const auto check = [&] { (files.check_read(), ...); };
  try {
    auto result = std::forward<Work>(work)();
    check();
    return result;
  } catch (...) {
    check();
    throw;
  }
}

}  // namespace raystage
