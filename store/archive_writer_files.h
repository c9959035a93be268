// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "base/error.h"
#include "base/posix_file.h"
#include "store/archive.h"
#include "store/matroska.h"

namespace raystage::store {

/// Throws Error (bad input) if no archive can have this description.
void check_description(const ArchiveWriter::Description& description,
                       const std::filesystem::path& archive);

/// The two open files of an ArchiveWriter and their end offsets.
struct ArchiveWriter::Files {
  /// Creates both.
  Files(const std::filesystem::path& archive_path, const std::filesystem::path& journal_path,
        const Description& description);
  struct Existing {};
  /// Opens both unchanged; resume() does the rest.
  Files(Existing, const std::filesystem::path& archive_path, const Description& description);

  void append(std::span<const NewFrame> frames);
  void close();
  void flush();

  /// Truncates both files to the last complete frame. Returns an Error that reports this with the
  /// text of errno.
  Error roll_back(const OutputFile& failed);
  void check(std::span<const NewFrame> frames) const;

  OutputFile archive;
  // Created second; if that fails, the archive is removed.
  std::unique_ptr<OutputFile> journal;
  matroska::Header header;
  std::uint64_t archive_end = 0, journal_end = 0;
  std::vector<matroska::CuePoint> cues;
  Nanoseconds last_time = -1, last_stored_time = -1;
  std::atomic<bool> directory_is_synced = false;
};

}  // namespace raystage::store
