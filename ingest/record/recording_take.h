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

namespace raystage {

/// A take during its recording. Unlike an imported take it has its final name from the beginning.
/// However the recording ends, the take can be opened: documents are written first, each frame
/// whole, and the account of the session last.
class RecordingTake {
 public:
  /// A new take. Throws Error: bad input where something of this name is there or the epoch is too
  /// far from now, failed for the disk; nothing is left then. Nor is it when this object goes
  /// before a session was written: the name is free for another try.
  static RecordingTake create(const std::filesystem::path& folder, TakeDocument take,
                              const RigDocument& rig, const std::string& node);
  /// Goes on with one, after a crash or a stop: the same cameras in the same order and size (for
  /// that see resume_take). Throws Error (bad input) where that is not so, or the epoch is too long
  /// ago.
  static RecordingTake resume(const std::filesystem::path& folder,
                              const std::vector<std::string>& camera_ids, const std::string& node);

  const std::filesystem::path& folder() const { return folder_; }
  const TakeDocument& document() const { return take_; }
  const RigDocument& rig() const { return rig_; }
  ArchiveWriter& archive(std::size_t camera) { return archives_[camera]; }
  /// Time of the last record when this session began, ns since the epoch; -1 without one.
  Nanoseconds last_time(std::size_t camera) const { return last_times_[camera]; }

  /// Takes the session up into TAKE/recording/NODE.json, or replaces the last one.
  void write_session(const RecordingDocument::Session& session, bool first);

  /// Room on the disk that is set aside for what must still be written when it is full.
  void reserve_disk_space();
  void release_disk_space();

  /// Closes the archives. An archive that cannot be closed is readable all the same; problems are
  /// added to `problems`.
  void close(std::vector<std::string>& problems);

  /// What is on disk since this session began, per camera: opened anew and counted.
  struct RecordCounts {
    std::array<std::uint64_t, kFrameStatusCount> by_status{};
  };
  RecordCounts count(std::size_t camera) const;

 private:
  /// A folder that goes with this object, unless it is kept.
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

  RecordingTake(std::filesystem::path folder, TakeDocument take, RigDocument rig,
                const std::string& node);
  void create_files();
  std::filesystem::path archive_path(std::size_t camera) const;
  std::filesystem::path journal_path(std::size_t camera) const;

  FolderCleanup folder_cleanup_;  // first: goes when the archives are closed
  std::filesystem::path folder_;
  TakeDocument take_;
  RigDocument rig_;
  std::filesystem::path recording_file_, reserve_file_;
  RecordingDocument recording_;
  std::vector<ArchiveWriter> archives_;
  std::vector<Nanoseconds> last_times_;
};

}  // namespace raystage
