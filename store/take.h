// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "base/contained_path.h"
#include "rig/rig.h"
#include "schemas/take_document.h"
#include "store/archive.h"

namespace raystage::store {

/// Supplies the archives of a take that are not in its folder.
class RemoteArchives {
 public:
  virtual ~RemoteArchives() = default;
  /// Returns the archive of a camera if another host has it, or nullopt if it is in the take's
  /// folder.
  virtual std::optional<ArchiveReader> open(int camera) const = 0;
  /// Returns whether no host has the camera's archive and this is accepted. The camera then has no
  /// frames: open() returns an archive without frames.
  virtual bool is_missing(int camera) const = 0;
  /// Returns whether no archive is known, so that the timeline must be used unchecked.
  virtual bool are_unknown() const { return false; }
};

/// A take on disk, opened for reading. Archives are opened on first use. Const members are
/// thread-safe.
class Take {
 public:
  /// Opens a take. Throws Error (bad input) if the folder is not a take, or take.json and rig.json
  /// are invalid or contradict each other.
  explicit Take(std::filesystem::path folder,
                std::shared_ptr<const RemoteArchives> remote = nullptr);
  ~Take();
  Take(Take&&) noexcept;
  Take& operator=(Take&&) noexcept;

  const std::filesystem::path& folder() const;
  /// Returns a file of the take, to be opened without leaving its folder.
  ContainedPath file(std::filesystem::path relative) const;
  const schemas::TakeDocument& document() const;
  const rig::Rig& rig() const;
  /// Throws Error (bad input) if a new take in `folder` would be inside of this one.
  void check_not_inside(const std::filesystem::path& folder) const;
  int camera_count() const;
  /// Returns the index of a camera by its id, or -1 if there is none.
  int camera_index(std::string_view id) const;
  /// Returns the archive of a camera. Throws Error (bad input) if it cannot be read, does not match
  /// the documents in camera, image size or epoch, or has the journal of another camera.
  const ArchiveReader& archive(int camera) const;
  /// Returns whether no host has the camera's archive; see RemoteArchives.
  bool is_missing(int camera) const;
  /// The unpacked frames of all cameras. Without packed frames it stays empty.
  UnpackedFrames& unpacked_frames() const;
  /// Returns whether archives on other hosts are unknown; see RemoteArchives::are_unknown().
  bool are_archives_unknown() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Writes a new take atomically: into a folder with a temporary name next to the target, which
/// commit() renames.
class TakeWriter {
 public:
  /// Throws Error (bad input) if there is a file or folder of the name of a new take.
  static void require_absent(const std::filesystem::path& folder);
  /// Begins a take. Fills in camera.archive and camera.journal of the document (archive/ID.mkv).
  /// Archives of cameras with Camera::pixels hold pictures (FrameCodec::kPicture), others `codec`.
  /// Throws Error (bad input) if `folder` exists or a camera id is not a safe file name. Throws
  /// Error (failed) if its parent folder is not writable.
  TakeWriter(const std::filesystem::path& folder, schemas::TakeDocument take,
             schemas::RigDocument rig, FrameCodec codec = FrameCodec::kJpeg);
  ~TakeWriter();  ///< removes what was not committed
  TakeWriter(const TakeWriter&) = delete;
  TakeWriter& operator=(const TakeWriter&) = delete;

  /// Returns the archive of a camera, created on first use. Different threads may write different
  /// cameras. Close each one when it is complete (commit() closes the rest): 64 open archives use
  /// 128 file descriptors.
  ArchiveWriter& archive(int camera);
  /// Returns the folder under its temporary name, for further files (truth images, views.json).
  const std::filesystem::path& working_folder() const;
  /// Closes the archives and writes the documents. The working folder then is a whole take, and
  /// derived files may be added. commit() calls this if needed.
  void finish();
  /// Writes only the documents: the archives stay where they are (archive/ID.mkv of other folders).
  void finish_documents();
  /// Sets the brightest light of a camera with Camera::pixels (PixelEncoding::peak), which may be
  /// known only after its last frame. Threads may set different cameras.
  void set_peak(int camera, double peak);
  /// Calls finish() if needed, then renames the folder.
  void commit();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::store
