// SPDX-License-Identifier: Apache-2.0
// Repairs a take from another copy of it. Archives are merged frame by frame (merge_pairs.h);
// documents are taken from the copy if they cannot be read here and can be read there.
#include "store/fixity/repair_from_copy.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "base/mapped_file.h"
#include "base/posix_file.h"
#include "schemas/recording_document.h"
#include "schemas/rig_document.h"
#include "schemas/take_document.h"
#include "store/fixity/manifest.h"
#include "store/fixity/merge_pairs.h"
#include "store/fixity/replace_pair.h"
#include "store/fixity/verify.h"
#include "store/timeline.h"
#include "store/timeline_file.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;
using schemas::RecordingDocument;

constexpr const char* kTakeFile = "take.json";
constexpr const char* kRigFile = "rig.json";

bool succeeds(const std::function<void()>& attempt) {
  try {
    attempt();
    return true;
  } catch (const Error&) {
    return false;
  }
}

Error another_take(const fs::path& copy, const std::string& what) {
  return Error::bad_input("the copy is of another take: " + what, copy.string(),
                          "Use a copy of this take");
}

/// Throws Error (bad input) if two takes differ in name, epoch or cameras.
void check_identity(const schemas::TakeDocument& take, const schemas::TakeDocument& copy,
                    const fs::path& folder) {
  if (take.name != copy.name) {
    throw another_take(folder, "its name is \"" + copy.name + "\", not \"" + take.name + "\"");
  }
  if (take.epoch_utc != copy.epoch_utc) {
    throw another_take(folder, "its epoch is " + format_utc(copy.epoch_utc) + ", not " +
                                   format_utc(take.epoch_utc));
  }
  const auto same = [](const auto& a, const auto& b) {
    return a.id == b.id && a.archive == b.archive && a.journal == b.journal && a.node == b.node;
  };
  if (!std::ranges::equal(take.cameras, copy.cameras, same)) {
    throw another_take(folder, "its cameras differ in id, file or node");
  }
}

/// The files of one camera in one folder, mapped.
struct PairInFolder {
  PairInFolder(const fs::path& folder, const ArchivePair& description)
      : files{folder / description.archive_name, folder / description.journal_name},
        pair(description) {
    for (const std::string& name : {pair.archive_name, pair.journal_name}) {
      require_contained({folder, name});
    }
    if (fs::exists(files.archive)) {
      archive.emplace(ContainedPath{folder, pair.archive_name});
      is_readable = archive->can_read(archive->bytes());
      if (is_readable) pair.archive = archive->bytes();
    }
    if (fs::exists(files.journal))
      pair.journal = journal.emplace(ContainedPath{folder, pair.journal_name}).bytes();
  }

  ExaminedPair examine() const {
    if (pair.archive.empty() && !pair.journal) return {pair, false, {}};
    ExaminedPair examined{pair, false, salvage_archive(pair)};
    examined.is_intact = verify_archive(pair, {}).is_intact();
    return examined;
  }

  /// Throws Error (failed) if another program truncated a file meanwhile.
  void check_read() const {
    if (archive && is_readable) archive->check_read();
    if (journal) journal->check_read();
  }

  PairFiles files;
  ArchivePair pair;
  std::optional<MappedFile> archive, journal;
  bool is_readable = true;
};

/// Returns whether `copy` knows more of the sessions of a recording than `own`.
bool is_further(const RecordingDocument& copy, const RecordingDocument& own) {
  if (copy.sessions.size() != own.sessions.size()) {
    return copy.sessions.size() > own.sessions.size();
  }
  return !own.sessions.empty() && copy.sessions.back().stopped_utc &&
         !own.sessions.back().stopped_utc;
}

}  // namespace

CopyOfTake::CopyOfTake(fs::path take, fs::path copy)
    : take_(std::move(take)), copy_(std::move(copy)) {
  const auto is_folder = [](const fs::path& path) {
    std::error_code error;
    return fs::is_directory(path, error);
  };
  const bool like_a_take =
      fs::exists(take_ / kTakeFile) || fs::exists(take_ / kRigFile) || is_folder(take_ / "archive");
  if (!is_folder(take_) || !like_a_take) {
    throw Error::bad_input("this is no take", take_.string(),
                           "Use the folder of the take; to restore all of it, copy the copy");
  }
  std::error_code error;
  if (fs::equivalent(take_, copy_, error)) {
    throw Error::bad_input("the copy is the take itself", copy_.string(),
                           "Use the folder of the other copy");
  }
  for (const fs::path& folder : {take_, copy_}) {
    for (const char* file : {kTakeFile, kRigFile}) require_contained({folder, file});
  }
  const Take other(copy_);
  has_own_documents_ = succeeds([&] { schemas::read_rig(ContainedPath{take_, kRigFile}); });
  std::optional<schemas::TakeDocument> own;
  has_own_documents_ = succeeds([&] {
                         own = schemas::read_take(ContainedPath{take_, kTakeFile});
                       }) &&
                       has_own_documents_;
  if (own) check_identity(*own, other.document(), copy_);
}

void CopyOfTake::restore(const std::string& file, bool dry_run,
                         std::vector<RepairReport::RestoredFile>& restored,
                         const std::function<void(const std::string& bytes)>& check) const {
  RepairReport::RestoredFile& entry = restored.emplace_back(RepairReport::RestoredFile{file, {}});
  try {
    for (const fs::path& folder : {take_, copy_}) require_contained({folder, file});
    const MappedFile source(ContainedPath{copy_, file});
    if (!source.can_read(source.bytes())) {
      throw Error::failed("the disk cannot read the file", (copy_ / file).string(),
                          "Check the disk of the copy");
    }
    if (check) check({reinterpret_cast<const char*>(source.bytes().data()), source.bytes().size()});
    if (dry_run) return source.check_read();
    create_folder((take_ / file).parent_path());
    remove_abandoned_temporary_files(take_ / file);
    const std::vector<std::byte> bytes(source.bytes().begin(), source.bytes().end());
    source.check_read();
    write_file_atomically(take_ / file, bytes);
  } catch (const Error& error) {
    entry.error = error.what();
  }
}

std::vector<RepairReport::RestoredFile> CopyOfTake::restore_documents(bool dry_run) const {
  std::vector<RepairReport::RestoredFile> restored;
  if (!succeeds([&] { schemas::read_take(ContainedPath{take_, kTakeFile}); })) {
    restore(kTakeFile, dry_run, restored,
            [](const std::string& text) { schemas::parse_take(text, kTakeFile); });
  }
  if (!succeeds([&] { schemas::read_rig(ContainedPath{take_, kRigFile}); })) {
    restore(kRigFile, dry_run, restored,
            [](const std::string& text) { schemas::parse_rig(text, kRigFile); });
  }
  for (const std::string& file : files_of_take(copy_)) {
    if (!file.starts_with("recording/") || !file.ends_with(".json")) continue;
    std::optional<RecordingDocument> own, copy;
    require_contained({take_, file});
    succeeds([&] { own = schemas::read_recording(ContainedPath{take_, file}); });
    if (!succeeds([&] { copy = schemas::read_recording(ContainedPath{copy_, file}); })) continue;
    if (own && !is_further(*copy, *own)) continue;
    restore(file, dry_run, restored,
            [&](const std::string& text) { schemas::parse_recording(text, file); });
  }
  return restored;
}

void CopyOfTake::repair_camera(ArchivePair description, bool dry_run,
                               RepairReport::Camera& result) const {
  const PairInFolder own(take_, description), copy(copy_, description);
  // Fails while a recorder runs, and prevents its start while this is open.
  std::optional<OutputFile> lock;
  if (!dry_run) {
    if (own.archive) lock.emplace(ContainedPath{take_, description.archive_name});
    for (const fs::path& file : {own.files.archive, own.files.journal}) {
      remove_abandoned_temporary_files(file);
    }
  }
  if (!own.archive && !copy.archive) {
    throw Error::bad_input("the archive is missing here and in the copy",
                           own.files.archive.string(), "Restore it from another copy");
  }
  const ExaminedPair own_pair = own.examine(), copy_pair = copy.examine();
  if (!copy.is_readable || (!own.is_readable && !copy_pair.is_intact)) {
    const fs::path& file = copy.is_readable ? own.files.archive : copy.files.archive;
    throw Error::failed("the disk cannot read all of the archive", file.string(),
                        "Copy the take to an intact disk with a tool that fills in unreadable "
                        "parts (ddrescue), and repair with that");
  }
  const MergedPair merged = merge_pairs(own_pair, copy_pair);
  const auto check_files = [&] {
    own.check_read();
    copy.check_read();
  };
  check_files();
  if (merged.equals_own) {
    result.was_intact = true;
    return;
  }
  result.frames_from_copy = merged.frames_from_copy;
  result.salvage.frames = merged.frames;
  result.salvage.losses = merged.losses;
  if (dry_run) return;
  create_folder(own.files.archive.parent_path());
  create_folder(own.files.journal.parent_path());
  const bool keep_originals = !merged.losses.empty() || !own.is_readable;
  result.kept = replace_pair(description, own.files, merged.frames, keep_originals,
                             [&](const fs::path& archive, const fs::path& journal) {
                               write_merged_pair(merged, copy.pair, description.description,
                                                 archive, journal);
                               check_files();
                             });
  result.repaired = true;
}

std::vector<RepairReport::RestoredFile> CopyOfTake::restore_derived(bool dry_run) const {
  std::vector<RepairReport::RestoredFile> restored;
  for (const std::string& file : files_of_take(copy_)) {
    const bool elsewhere = file == kTakeFile || file == kRigFile || file == kTimelineFile ||
                           file.starts_with("archive/") || file.starts_with("recording/");
    if (elsewhere || fs::exists(fs::symlink_status(take_ / file))) continue;
    restore(file, dry_run, restored, {});
  }
  const std::array<const char*, 2> manifest{kManifestFile, kSignatureFile};
  for (const char* file : manifest) {
    if (fs::exists(take_ / file) || !fs::exists(copy_ / file)) continue;
    restore(file, dry_run, restored, {});
  }
  const std::string timeline(kTimelineFile);
  require_contained({take_, timeline});
  require_contained({copy_, timeline});
  const auto reads = [&](const fs::path& folder) {
    return fs::exists(folder / timeline) && succeeds([&] { read_timeline(Take(folder)); });
  };
  if (!reads(take_) && reads(copy_)) restore(timeline, dry_run, restored, {});
  return restored;
}

}  // namespace raystage::store
