// SPDX-License-Identifier: Apache-2.0
// Repairs a take from another copy of it. Archives are merged frame by frame (merge_pairs.h);
// documents are taken from the copy if they cannot be read here and can be read there.
#include "store/fixity/repair_from_copy.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <system_error>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "base/mapped_file.h"
#include "base/posix_file.h"
#include "schemas/imported_depths_document.h"
#include "schemas/recording_document.h"
#include "schemas/rig_document.h"
#include "schemas/take_document.h"
#include "store/fixity/manifest.h"
#include "store/fixity/merge_pairs.h"
#include "store/fixity/replace_pair.h"
#include "store/fixity/restorable_depths.h"
#include "store/fixity/verify.h"
#include "store/matroska.h"
#include "store/timeline.h"
#include "store/timeline_file.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;
using schemas::ImportedDepthsDocument;
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

void check_take(const std::string& text) { schemas::parse_take(text, kTakeFile); }
void check_rig(const std::string& text) { schemas::parse_rig(text, kRigFile); }

enum class State { kValid, kMissing, kInvalid };

/// Returns the state of a document; `parse` throws Error if its contents are not valid. Throws
/// Error if that is unknown because the file cannot be read.
State state_of(const ContainedPath& file, const std::function<void(const std::string&)>& parse) {
  require_contained(file);
  std::error_code error;
  const fs::file_status status = fs::symlink_status(file.path(), error);
  if (status.type() == fs::file_type::not_found) return State::kMissing;
  if (error) {
    throw Error::failed("the file cannot be examined: " + error.message(), file.path().string(),
                        "Check its permissions");
  }
  const std::string text = read_file(file);
  return succeeds([&] { parse(text); }) ? State::kValid : State::kInvalid;
}

/// Calls `use` with consecutive parts of a file's bytes. Throws Error (failed) if the disk cannot
/// read them, another program truncates the file, or a stop is requested.
void for_each_part(const MappedFile& file, const fs::path& name, const std::stop_token& stop,
                   const std::function<void(std::span<const std::byte>)>& use) {
  constexpr std::size_t kPart = 1 << 20;  // bytes in memory at a time
  for (auto rest = file.bytes(); !rest.empty();) {
    if (stop.stop_requested()) {
      throw Error::failed("the repair was stopped", name.string(), "Repair the take again");
    }
    const auto part = rest.first(std::min(rest.size(), kPart));
    if (!file.can_read(part)) {
      file.check_read();
      throw Error::failed("the disk cannot read the file", name.string(),
                          "Check the disk of the copy");
    }
    use(part);
    rest = rest.subspan(part.size());
  }
  file.check_read();
}

/// Throws Error (failed) if a file of this size does not fit the disk: it may be a hole of a
/// terabyte, which takes no space in the copy.
void check_free_space(const fs::path& source, std::size_t bytes, const fs::path& take) {
  std::error_code error;
  const fs::space_info space = fs::space(take, error);
  if (error || space.available >= bytes) return;
  throw Error::failed(
      fmt::format("it has {:.1f} MB, the disk of the take {:.1f} MB free",
                  static_cast<double>(bytes) * 1e-6, static_cast<double>(space.available) * 1e-6),
      source.string(), "Free space on the disk");
}

void copy_to(const MappedFile& source, const fs::path& name, const fs::path& target,
             const std::stop_token& stop) {
  OutputFile out(target, OutputFile::Open::kExisting);
  std::vector<std::byte> buffer;  // the kernel would refuse a truncated map with another error
  std::uint64_t offset = 0;
  const auto check = [&](bool is_written) {
    if (is_written) return;
    throw Error::from_errno("the file cannot be written", target.string(),
                            "Free space on the disk");
  };
  for_each_part(source, name, stop, [&](std::span<const std::byte> part) {
    buffer.assign(part.begin(), part.end());
    const bool is_hole = std::ranges::all_of(buffer, [](std::byte b) { return b == std::byte{}; });
    if (!is_hole) check(out.write_at(offset, buffer));
    offset += buffer.size();
  });
  check(out.truncate(offset));  // which holes at the end need
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
    if (exists(ContainedPath{folder, pair.archive_name})) {
      archive.emplace(ContainedPath{folder, pair.archive_name});
      is_readable = archive->can_read(archive->bytes());
      if (is_readable) pair.archive = archive->bytes();
    }
    const ContainedPath journal_file{folder, pair.journal_name};
    if (exists(journal_file)) pair.journal = journal.emplace(journal_file).bytes();
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

  /// The same, also of an archive that the disk cannot read or another program truncated before.
  void check_not_truncated() const {
    if (archive) archive->check_read();
    if (journal) journal->check_read();
  }

  PairFiles files;
  ArchivePair pair;
  std::optional<MappedFile> archive, journal;
  bool is_readable = true;
};

/// Merges one archive and its journal with those of the copy, and writes the result over `own`
/// unless dry_run.
void merge(const PairInFolder& own, const PairInFolder& copy, bool dry_run,
           RepairReport::Camera& result) {
  if (!own.archive && !copy.archive) {
    throw Error::bad_input("the archive is missing here and in the copy",
                           own.files.archive.string(), "Restore it from another copy");
  }
  const auto codec_of = [](const PairInFolder& side) { return header_of_pair(side.pair).codec; };
  const FrameCodec codec = codec_of(own.archive ? own : copy);
  if (own.archive && copy.archive && codec_of(copy) != codec) {
    throw Error::bad_input(
        "the frames of the two archives have different forms", copy.files.archive.string(),
        "Make a copy of the same form with `raystage pack` or `raystage unpack`");
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
  if (merged.frames < own_pair.saved.frames) {
    throw Error::failed(fmt::format("the result would have {} frames instead of the {} that are "
                                    "here; nothing was changed",
                                    merged.frames, own_pair.saved.frames),
                        own.files.archive.string(), "Report this with both files");
  }
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
  const bool keep_originals =
      !merged.losses.empty() || merged.has_unidentified_damage || !own.is_readable;
  result.kept = replace_pair(own.pair, own.files, merged.frames, keep_originals,
                             [&](const fs::path& archive, const fs::path& journal) {
                               ArchiveWriter::Description description = own.pair.description;
                               description.codec = codec;
                               write_merged_pair(merged, copy.pair, description, archive, journal);
                               check_files();
                             });
  result.repaired = true;
}

/// Returns whether `copy` knows more of the sessions of a recording than `own`.
bool is_further(const RecordingDocument& copy, const RecordingDocument& own) {
  if (copy.sessions.size() != own.sessions.size()) {
    return copy.sessions.size() > own.sessions.size();
  }
  return !own.sessions.empty() && copy.sessions.back().stopped_utc &&
         !own.sessions.back().stopped_utc;
}

}  // namespace

CopyOfTake::CopyOfTake(fs::path take, fs::path copy, std::stop_token stop)
    : take_(std::move(take)), copy_(std::move(copy)), stop_(std::move(stop)) {
  const bool like_a_take = file_exists(take_ / kTakeFile) || file_exists(take_ / kRigFile) ||
                           is_folder(take_ / "archive");
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
  std::optional<schemas::TakeDocument> own;
  const State take_state = state_of({take_, kTakeFile}, [&](const std::string& text) {
    own = schemas::parse_take(text, kTakeFile);
  });
  const State rig_state = state_of({take_, kRigFile}, check_rig);
  has_own_documents_ = take_state == State::kValid && rig_state == State::kValid;
  if (own) check_identity(*own, other.document(), copy_);
  copied_files_ = find_files_of_take(copy_);
}

void CopyOfTake::restore(const std::string& file, bool dry_run, bool keep_old,
                         std::vector<RepairReport::RestoredFile>& restored,
                         const Check& check) const {
  RepairReport::RestoredFile& entry = restored.emplace_back(RepairReport::RestoredFile{file, {}});
  try {
    for (const fs::path& folder : {take_, copy_}) require_contained({folder, file});
    const MappedFile source(ContainedPath{copy_, file});
    std::string text;
    check_free_space(copy_ / file, source.bytes().size(), take_);
    const bool load = check != nullptr;
    if (load && source.bytes().size() > kMaxFileBytes) {
      throw Error::bad_input("it is too large for a document", (copy_ / file).string(),
                             "Use another copy");
    }
    if (load || dry_run) {
      for_each_part(source, copy_ / file, stop_, [&](std::span<const std::byte> part) {
        if (load) text.append(reinterpret_cast<const char*>(part.data()), part.size());
      });
    }
    if (load) check(text);
    if (dry_run) return;
    const fs::path target = take_ / file;
    create_folder(target.parent_path());
    remove_abandoned_temporary_files(target);
    check_writable(target);
    TemporaryFile written(target);
    copy_to(source, copy_ / file, written.path(), stop_);
    if (keep_old && is_name_taken(target)) keep_original(target);
    written.commit();
  } catch (const Error& error) {
    entry.error = error.what();
  }
}

std::vector<RepairReport::RestoredFile> CopyOfTake::restore_documents(bool dry_run) const {
  std::vector<RepairReport::RestoredFile> restored;
  // Restores a document unless it is valid, and nothing if that is unknown.
  const auto restore_invalid = [&](const std::string& file, const Check& own, const Check& copy,
                                   const std::function<bool()>& is_behind) {
    State state = State::kMissing;
    try {
      state = state_of({take_, file}, own);
    } catch (const Error& error) {
      restored.push_back({file, error.what()});
      return;
    }
    if (state == State::kValid && !is_behind()) return;
    restore(file, dry_run, state == State::kInvalid, restored, copy);
  };
  const auto never = [] { return false; };
  restore_invalid(kTakeFile, check_take, check_take, never);
  restore_invalid(kRigFile, check_rig, check_rig, never);
  if (const ContainedPath maps{take_, ImportedDepthsDocument::kFile};
      is_contained(maps) && is_name_taken(copy_ / maps.relative)) {
    const auto check = [](const std::string& text) {
      schemas::parse_imported_depths(text, ImportedDepthsDocument::kFile);
    };
    const auto check_copy = [&](const std::string& text) { check_list_of_maps(take_, text); };
    restore_invalid(maps.relative, check, check_copy, never);
  }
  for (const std::string& file : copied_files_.paths) {
    if (!file.starts_with("recording/") || !file.ends_with(".json")) continue;
    std::optional<RecordingDocument> own, copy;
    require_contained({take_, file});
    if (!succeeds([&] { copy = schemas::read_recording(ContainedPath{copy_, file}); })) continue;
    restore_invalid(
        file, [&](const std::string& text) { own = schemas::parse_recording(text, file); },
        [&](const std::string& text) { schemas::parse_recording(text, file); },
        [&] { return is_further(*copy, *own); });
  }
  return restored;
}

void CopyOfTake::repair_camera(const ArchivePair& description, bool dry_run,
                               RepairReport::Camera& result) const {
  for (const std::string& name : {description.archive_name, description.journal_name}) {
    require_contained({take_, name});
  }
  // Before the files are mapped: fails while a recorder runs, and prevents its start while this is
  // open. Otherwise what it appends meanwhile would be overwritten.
  std::optional<OutputFile> lock;
  if (!dry_run) {
    const fs::path archive = take_ / description.archive_name;
    const ContainedPath own_archive{take_, description.archive_name};
    if (exists(own_archive)) lock.emplace(own_archive);
    // Of repairs that were killed. Whoever writes them holds the lock, if there is one.
    const Owners owners = lock && lock->is_locked() ? Owners::kAll : Owners::kEnded;
    for (const fs::path& file : {archive, take_ / description.journal_name}) {
      remove_abandoned_temporary_files(file, owners);
    }
  }
  const PairInFolder own(take_, description), copy(copy_, description);
  if (!dry_run && own.archive && !lock) {
    throw Error::failed("another program has created the archive meanwhile",
                        own.files.archive.string(), "Repair the take when that has ended");
  }
  try {
    merge(own, copy, dry_run, result);
  } catch (const Error&) {
    result.salvage = {};
    result.frames_from_copy = 0;
    own.check_not_truncated();  // otherwise the error is what it found in zeros
    copy.check_not_truncated();
    throw;
  }
}

std::vector<RepairReport::RestoredFile> CopyOfTake::restore_derived(bool dry_run) const {
  std::vector<RepairReport::RestoredFile> restored;
  for (const std::string& file : copied_files_.paths) {
    const bool elsewhere = file == kTakeFile || file == kRigFile || file == kTimelineFile ||
                           file == ImportedDepthsDocument::kFile || file.starts_with("archive/") ||
                           file.starts_with("recording/");
    // What a repair of the copy has set aside.
    const bool set_aside = fs::path(file).extension().string().starts_with(".damaged");
    if (elsewhere || set_aside) continue;
    const bool is_here = is_name_taken(take_ / file);
    if (is_here && !is_damaged_map(file, take_, copy_)) continue;
    restore(file, dry_run, is_here, restored, {});
  }
  const std::array<const char*, 2> manifest{kManifestFile, kSignatureFile};
  for (const char* file : manifest) {
    if (is_name_taken(take_ / file) || !is_name_taken(copy_ / file)) continue;
    restore(file, dry_run, false, restored, {});
  }
  const std::string timeline(kTimelineFile);
  require_contained({take_, timeline});
  require_contained({copy_, timeline});
  const auto reads = [&](const fs::path& folder) {
    return file_exists(folder / timeline) && succeeds([&] { read_timeline(Take(folder)); });
  };
  if (!reads(take_) && reads(copy_)) restore(timeline, dry_run, true, restored, {});
  return restored;
}

}  // namespace raystage::store
