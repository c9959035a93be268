// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "schemas/recording_document.h"
#include "schemas/rig_document.h"
#include "schemas/take_document.h"
#include "store/archive.h"

namespace raystage::ingest {

/// Writes a take during its recording. Unlike an imported take it has its final name from the
/// beginning. It can be opened however the recording ends: documents are written first, frames are
/// written completely, and the session document is written last.
class RecordingTake {
 public:
  /// Creates a take. Throws Error (bad input) if `folder` exists or the epoch is more than 104 days
  /// from now, or Error (failed) on a disk error. The folder is removed after an error, and if this
  /// object is destroyed before a session was written.
  static RecordingTake create(const std::filesystem::path& folder, schemas::TakeDocument take,
                              const schemas::RigDocument& rig, const std::string& node);
  /// Creates an empty copy of a take, whose archives have the same form (packed or not), for
  /// complete_from(). Throws as create(), and as ArchiveReader.
  static RecordingTake create_copy(const std::filesystem::path& folder,
                                   const RecordingTake& source);
  /// Continues a take after a crash or a stop. Throws Error (bad input) if its cameras differ in id
  /// or order, or its epoch is more than 104 days from now. Sizes are checked by resume_take().
  /// `other`: folder of another copy, empty if there is none. Records that a crash prevented are
  /// taken from it. Throws Error (bad input) before anything is written if the copies differ
  /// otherwise than in how far they go, or lack a journal.
  static RecordingTake resume(const std::filesystem::path& folder,
                              const std::vector<std::string>& camera_ids, const std::string& node,
                              const std::filesystem::path& other = {});

  const std::filesystem::path& folder() const { return folder_; }
  const schemas::TakeDocument& document() const { return take_; }
  const schemas::RigDocument& rig() const { return rig_; }
  store::ArchiveWriter& archive(std::size_t camera) { return archives_[camera]; }
  /// Returns the time of the last record before this session, ns since the epoch; -1: no record.
  Nanoseconds last_time(std::size_t camera) const { return last_times_[camera]; }

  /// Appends to each archive the records that `other`, a copy of this take, has in addition, and
  /// takes its account if that has more sessions. Both must be open but unchanged since then.
  /// Returns the number of appended records. Throws Error (bad input) if the copies differ
  /// otherwise, and Error (failed) if the disk fails.
  std::size_t complete_from(const RecordingTake& other);

  /// Writes TAKE/recording/NODE.json: adds the session if `first`, otherwise replaces the last one.
  void write_session(const schemas::RecordingDocument::Session& session, bool first);

  /// Reserves disk space for the records that must still be written when the disk is full.
  void reserve_disk_space();
  void release_disk_space();

  /// Closes the archives and appends errors to `problems`. An archive that cannot be closed is
  /// still readable.
  void close(std::vector<std::string>& problems);

  struct RecordCounts {
    std::array<std::uint64_t, store::kFrameStatusCount> by_status{};
  };
  /// Opens the archive of a camera again and counts its records since this session began.
  RecordCounts count(std::size_t camera) const;

 private:
  /// Removes a folder on destruction, unless keep() was called.
  class FolderCleanup {
   public:
    FolderCleanup() = default;
    explicit FolderCleanup(std::filesystem::path folder) : folder_(std::move(folder)) {}
    ~FolderCleanup();
    FolderCleanup(FolderCleanup&& other) noexcept : folder_(std::exchange(other.folder_, {})) {}
    FolderCleanup& operator=(FolderCleanup&& other) noexcept {
      std::swap(folder_, other.folder_);
      return *this;
    }
    void keep() { folder_.clear(); }

   private:
    std::filesystem::path folder_;
  };

  RecordingTake(std::filesystem::path folder, schemas::TakeDocument take, schemas::RigDocument rig,
                const std::string& node);
  static RecordingTake create(const std::filesystem::path& folder, schemas::TakeDocument take,
                              const schemas::RigDocument& rig, const std::string& node,
                              const std::vector<store::FrameCodec>& codecs);
  void create_files(const std::vector<store::FrameCodec>& codecs);
  /// Throws Error (bad input) unless one copy of each archive is the beginning of the other. Only
  /// reads.
  void compare_with(const std::filesystem::path& other, const schemas::TakeDocument& there) const;
  /// Throws Error (bad input) if a file that a recording writes is, or is behind, a link.
  void require_contained_files() const;
  std::filesystem::path archive_path(std::size_t camera) const;
  std::filesystem::path journal_path(std::size_t camera) const;

  FolderCleanup folder_cleanup_;  // first: runs after the archives are closed
  std::filesystem::path folder_;
  schemas::TakeDocument take_;
  schemas::RigDocument rig_;
  std::filesystem::path recording_file_, reserve_file_;
  schemas::RecordingDocument recording_;
  std::vector<store::ArchiveWriter> archives_;
  std::vector<Nanoseconds> last_times_;
};

}  // namespace raystage::ingest
