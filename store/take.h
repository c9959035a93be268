// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "rig/rig.h"
#include "schemas/take_document.h"
#include "store/archive.h"

namespace raystage {

/// The archives of a take that are not in its folder.
class RemoteArchives {
 public:
  virtual ~RemoteArchives() = default;
  /// Returns the archive of a camera that another host holds; nothing: it is in the take's folder.
  virtual std::optional<ArchiveReader> open(int camera) const = 0;
  /// Whether no host holds the camera's archive, and that is accepted: it has no frame then, at any
  /// time (open() returns an archive without frames).
  virtual bool is_missing(int camera) const = 0;
  /// Whether nothing is known of any archive, so that the timeline must be taken as it is.
  virtual bool are_unknown() const { return false; }
};

/// A take on disk, opened for reading. Archives are opened when first asked for; const members may
/// be called from many threads at once.
class Take {
 public:
  /// Throws Error (bad input) where the folder is no take, take.json or rig.json is wrong, or they
  /// disagree.
  explicit Take(std::filesystem::path folder,
                std::shared_ptr<const RemoteArchives> remote = nullptr);
  ~Take();
  Take(Take&&) noexcept;
  Take& operator=(Take&&) noexcept;

  const std::filesystem::path& folder() const;
  const TakeDocument& document() const;
  const Rig& rig() const;
  /// Throws Error (bad input) where a new take in `folder` would lie within this one.
  void refuse_inside(const std::filesystem::path& folder) const;
  int camera_count() const;
  /// Index of a camera by id, -1 where there is none.
  int camera_index(std::string_view id) const;
  /// Throws Error (bad input) where the archive cannot be read, is of another camera, image size or
  /// epoch than the documents say, or has another camera's journal.
  const ArchiveReader& archive(int camera) const;
  /// Whether the camera's archive is missing everywhere: see RemoteArchives.
  bool is_missing(int camera) const;
  /// See RemoteArchives::are_unknown().
  bool are_archives_unknown() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Writes a new take: everything goes to a folder with a temporary name beside the target, which
/// commit() renames, so a take is there whole or not at all.
class TakeWriter {
 public:
  /// Throws Error: bad input where `folder` exists already, failed where its parent cannot be
  /// written to.
  /// camera.archive and camera.journal of the document are filled in here (archive/ID.mkv); ids
  /// that are no safe file names are refused (bad input).
  TakeWriter(const std::filesystem::path& folder, TakeDocument take, RigDocument rig);
  ~TakeWriter();  ///< removes what was not committed
  TakeWriter(const TakeWriter&) = delete;
  TakeWriter& operator=(const TakeWriter&) = delete;

  /// Created when first asked for. Different cameras may be written from different threads. Close
  /// each when it is done (commit does too): 64 open archives hold 128 file descriptors.
  ArchiveWriter& archive(int camera);
  /// The folder under its temporary name, for further files (truth images, views.json).
  const std::filesystem::path& working_folder() const;
  /// Closes the archives and writes the documents: the working folder is a whole take then, and
  /// what is derived from it may be added. commit() does it where it was not called.
  void finish();
  /// The same without archives, which stay where they are (archive/ID.mkv of other folders).
  void finish_documents();
  /// Finishes, renames the folder.
  void commit();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage
