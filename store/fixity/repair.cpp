// SPDX-License-Identifier: Apache-2.0
// Repairs the archives of a take from what can be saved (salvage.h): writes each damaged pair anew,
// verifies it, and renames it over the originals. Cameras run in parallel. Frames of video that
// refer to lost ones follow, when what is lost of all cameras is known.
#include "store/fixity/repair.h"

#include <tbb/task_arena.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <optional>
#include <set>
#include <span>
#include <system_error>
#include <utility>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "base/mapped_file.h"
#include "base/parallel.h"
#include "base/posix_file.h"
#include "schemas/imported_depths_document.h"
#include "store/fixity/renumber_frames.h"
#include "store/fixity/repair_from_copy.h"
#include "store/fixity/replace_pair.h"
#include "store/fixity/undecodable_frames.h"
#include "store/fixity/verify.h"
#include "store/matroska.h"
#include "store/timeline.h"
#include "store/timeline_file.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;

class CameraRepair {
 public:
  CameraRepair(const Take& take, int camera, const RepairOptions& options)
      : options_(options),
        folder_(take.folder()),
        pair_(describe_pair(take, camera)),
        files_{take.folder() / pair_.archive_name, take.folder() / pair_.journal_name} {}

  void run(RepairReport::Camera& result) {
    open();
    if (!archive_->can_read(archive_->bytes())) {
      check_files();
      throw Error::failed("the disk cannot read all of the archive", files_.archive.string(),
                          "Copy the take to an intact disk with a tool that fills in unreadable "
                          "parts (ddrescue), and repair the copy");
    }
    checked(result, [&] {
      const bool is_intact = verify_archive(pair_, {}).is_intact();
      if (!is_intact) require_writable();
      if (!is_intact) result.salvage = salvage_archive(pair_);
      check_files();
      result.was_intact = is_intact;
      if (!is_intact) replace(result, !result.salvage.losses.empty());
    });
  }

  /// Makes frames lost that refer to lost ones. Their bytes stay in the originals.
  void drop(std::span<const AffectedFrame> undecodable, RepairReport::Camera& result) {
    open();
    checked(result, [&] {
      require_writable();
      SalvageResult now = salvage_archive(pair_);
      check_files();
      std::set<Nanoseconds> times;
      for (const AffectedFrame& frame : undecodable) times.insert(frame.time_ns);
      for (FrameRecord& record : now.records) {
        if (record.status != FrameStatus::kStored || !times.contains(record.time_ns)) continue;
        record.status = FrameStatus::kTorn;
        record.is_unverified = false;
        record.offset = record.size = record.xxh3 = 0;
        --now.frames;
        ++result.undecodable_frames;
        result.salvage.losses.push_back(
            {record.time_ns, "a frame of video refers to a lost one and cannot be decoded"});
      }
      result.salvage.records = std::move(now.records);
      result.salvage.frames = now.frames;
      result.was_intact = false;
      const bool has_originals = !result.kept.empty();
      replace(result, !has_originals);
    });
  }

 private:
  void open() {
    for (const std::string& name : {pair_.archive_name, pair_.journal_name}) {
      require_contained({folder_, name});
    }
    if (!exists(ContainedPath{folder_, pair_.archive_name})) {
      throw Error::bad_input("the archive is missing", files_.archive.string(),
                             "Restore it from a copy");
    }
    // An intact archive stays as it is, and may be on a disk that is mounted read-only.
    if (!options_.dry_run && ::access(files_.archive.c_str(), W_OK) == 0) {
      lock();
      // Of repairs that were killed. Whoever writes them holds the lock, if there is one.
      const Owners owners = lock_->is_locked() ? Owners::kAll : Owners::kEnded;
      for (const fs::path& file : {files_.archive, files_.journal}) {
        remove_abandoned_temporary_files(file, owners);
      }
    }
    archive_.emplace(ContainedPath{folder_, pair_.archive_name});
    const ContainedPath journal{folder_, pair_.journal_name};
    if (exists(journal)) pair_.journal = journal_.emplace(journal).bytes();
    pair_.archive = archive_->bytes();
  }

  /// Fails while a recorder runs, and prevents its start as long as this exists.
  void lock() { lock_.emplace(ContainedPath{folder_, pair_.archive_name}); }
  void require_writable() {
    if (!options_.dry_run && !lock_) lock();  // throws
  }

  /// Fails where another program truncated a file meanwhile.
  void check_files() const {
    archive_->check_read();
    if (journal_) journal_->check_read();
  }

  template <class Work>
  void checked(RepairReport::Camera& result, const Work& work) const {
    try {
      work();
    } catch (const Error&) {
      result.salvage = {};
      check_files();  // otherwise the error is what it found in zeros
      throw;
    }
  }

  void replace(RepairReport::Camera& result, bool keep_originals) {
    if (options_.dry_run) return;
    const auto kept =
        replace_pair(pair_, files_, result.salvage.frames, keep_originals,
                     [&](const fs::path& archive, const fs::path& journal) {
                       write_salvaged_archive(pair_, result.salvage, archive, journal);
                       check_files();
                     });
    result.kept.insert(result.kept.end(), kept.begin(), kept.end());
    result.repaired = true;
  }

  const RepairOptions& options_;
  fs::path folder_;
  ArchivePair pair_;
  PairFiles files_;
  std::optional<OutputFile> lock_;
  std::optional<MappedFile> archive_, journal_;
};

/// Makes frames of video lost that refer to lost ones, so that the take has no frame that nobody
/// can decode. Without a copy only: another copy may still have what they refer to.
void drop_undecodable_frames(const fs::path& folder, const RepairOptions& options,
                             RepairReport& report) {
  const Take take(folder);
  if (std::ranges::all_of(report.cameras, &RepairReport::Camera::was_intact) &&
      !has_torn_records(take)) {
    return;
  }
  FrameTimes damaged(report.cameras.size());
  if (options.dry_run) {
    for (std::size_t i = 0; i < damaged.size(); ++i) {
      for (const auto& [time, hash] : report.cameras[i].salvage.lost_hashes) {
        damaged[i].insert(time);
      }
    }
  }
  const auto undecodable = find_undecodable_frames(take, damaged);
  parallel_for(std::size_t{0}, undecodable.size(), [&](std::size_t i) {
    if (undecodable[i].empty()) return;
    RepairReport::Camera& camera = report.cameras[i];
    try {
      CameraRepair(take, static_cast<int>(i), options).drop(undecodable[i], camera);
    } catch (const Error& error) {
      camera.error = error.what();
    }
  });
}

// Renumbers a timeline that no longer matches the frame tables, or renames it: every reader would
// reject it.
void mend_timeline(const fs::path& folder, const NumberedFrames& before, RepairReport& report) {
  const fs::path file = folder / kTimelineFile;
  try {
    if (!exists(ContainedPath{folder, kTimelineFile})) return;
    read_timeline(Take(folder));
  } catch (const Error&) {
    report.is_timeline_renumbered = renumber_timeline(before, folder);
    if (report.is_timeline_renumbered) return;
    report.renamed_timeline = keep_original(file);
    std::error_code gone_already;
    fs::remove(file, gone_already);
  }
}

}  // namespace

bool RepairReport::has_losses() const {
  return std::ranges::any_of(cameras, [](const Camera& c) { return !c.salvage.losses.empty(); });
}

bool RepairReport::failed() const {
  return std::ranges::any_of(cameras, [](const Camera& c) { return !c.error.empty(); }) ||
         std::ranges::any_of(files, [](const RestoredFile& file) { return !file.error.empty(); });
}

void write_salvaged_archive(const ArchivePair& pair, const SalvageResult& salvaged,
                            const fs::path& archive, const fs::path& journal) {
  ArchiveWriter::Description description = pair.description;
  description.codec = matroska::header_of_file(pair.archive, description).codec;
  ArchiveWriter out(archive, journal, description);
  for (const FrameRecord& record : salvaged.records) {
    // Offset and size of a missing frame are 0.
    out.append_again(record,
                     pair.archive.subspan(static_cast<std::size_t>(record.offset), record.size));
  }
  out.close();
}

RepairReport repair_take(const fs::path& folder, const RepairOptions& options) {
  RepairReport report;
  std::optional<CopyOfTake> copy;
  if (options.copy) {
    copy.emplace(folder, *options.copy);
    report.files = copy->restore_documents(options.dry_run);
  }
  // In a dry run take.json may be missing still.
  const fs::path& described =
      copy && !copy->has_own_documents() && options.dry_run ? *options.copy : folder;
  const Take take(described);
  NumberedFrames before;
  if (!options.dry_run) before = read_numbered_frames(folder);
  const auto cameras = static_cast<std::size_t>(take.camera_count());
  report.cameras.resize(cameras);
  std::atomic<std::size_t> done = 0;
  // One camera per thread: each has its own files.
  const auto threads = static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
  parallel_for_in_order(
      cameras, threads, [&] { return options.stop.stop_requested(); },
      [&](std::size_t i) {
        RepairReport::Camera& camera = report.cameras[i];
        camera.id = take.document().cameras[i].id;
        try {
          if (copy) {
            copy->repair_camera(describe_pair(take, static_cast<int>(i)), options.dry_run, camera);
          } else {
            CameraRepair(take, static_cast<int>(i), options).run(camera);
          }
        } catch (const Error& error) {
          camera.error = error.what();
        }
        const std::size_t so_far = ++done;
        if (options.progress) {
          options.progress(static_cast<double>(so_far) / static_cast<double>(cameras));
        }
      });
  report.status = done < cameras ? RunStatus::kStopped : RunStatus::kFinished;
  if (report.status != RunStatus::kFinished || report.failed()) return report;
  if (!copy) drop_undecodable_frames(folder, options, report);
  if (report.failed()) return report;
  if (copy) {
    const auto restored = copy->restore_derived(options.dry_run);
    report.files.insert(report.files.end(), restored.begin(), restored.end());
  }
  if (report.failed()) return report;
  if (options.dry_run) {
    const auto loses_frames = [](const RepairReport::Camera& camera) {
      return !camera.salvage.lost_hashes.empty() || camera.undecodable_frames > 0;
    };
    report.is_timeline_renumbered = !copy && exists(ContainedPath{folder, kTimelineFile}) &&
                                    std::ranges::any_of(report.cameras, loses_frames);
    return report;
  }
  mend_timeline(folder, before, report);
  const auto is_list = [](const RepairReport::RestoredFile& file) {
    return file.path == schemas::ImportedDepthsDocument::kFile;
  };
  // The numbers of a list from the copy are those of the copy.
  if (std::ranges::none_of(report.files, is_list)) {
    report.lost_imported_maps = renumber_imported_depths(before, folder);
  }
  return report;
}

}  // namespace raystage::store
