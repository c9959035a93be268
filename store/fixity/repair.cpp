// SPDX-License-Identifier: Apache-2.0
// Repairs the archives of a take from what can be saved (salvage.h): writes each damaged pair anew,
// verifies it, and renames it over the originals. Cameras run in parallel.
#include "store/fixity/repair.h"

#include <tbb/task_arena.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <optional>
#include <system_error>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "base/mapped_file.h"
#include "base/parallel.h"
#include "base/posix_file.h"
#include "store/fixity/renumber_timeline.h"
#include "store/fixity/repair_from_copy.h"
#include "store/fixity/replace_pair.h"
#include "store/fixity/verify.h"
#include "store/matroska.h"
#include "store/temporal/temporal_frame.h"
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
        archive_path_(take.folder() / pair_.archive_name),
        journal_path_(take.folder() / pair_.journal_name) {}

  void run(RepairReport::Camera& result) {
    for (const std::string& name : {pair_.archive_name, pair_.journal_name}) {
      require_contained({folder_, name});
    }
    if (!exists(ContainedPath{folder_, pair_.archive_name})) {
      throw Error::bad_input("the archive is missing", archive_path_.string(),
                             "Restore it from a copy");
    }
    // Fails while a recorder runs, and prevents its start while this is open.
    std::optional<OutputFile> lock;
    const auto open_for_writing = [&] { lock.emplace(ContainedPath{folder_, pair_.archive_name}); };
    // An intact archive stays as it is, and may be on a disk that is mounted read-only.
    const bool is_writable = ::access(archive_path_.c_str(), W_OK) == 0;
    if (!options_.dry_run && is_writable) {
      open_for_writing();
      // Of repairs that were killed. Whoever writes them holds the lock, if there is one.
      const Owners owners = lock->is_locked() ? Owners::kAll : Owners::kEnded;
      for (const fs::path& file : {archive_path_, journal_path_}) {
        remove_abandoned_temporary_files(file, owners);
      }
    }
    const MappedFile archive(ContainedPath{folder_, pair_.archive_name});
    std::optional<MappedFile> journal;
    const ContainedPath journal_file{folder_, pair_.journal_name};
    if (exists(journal_file)) pair_.journal = journal.emplace(journal_file).bytes();
    pair_.archive = archive.bytes();
    // Fails where another program truncated a file meanwhile.
    const auto check_files = [&] {
      archive.check_read();
      if (journal) journal->check_read();
    };
    const auto can_read = [&](std::span<const std::byte> bytes) {
      while (!bytes.empty()) {
        if (options_.stop.stop_requested()) throw Cancelled{};
        const auto part = bytes.first(std::min(kReadPart, bytes.size()));
        if (!archive.can_read(part)) return false;
        bytes = bytes.subspan(part.size());
      }
      return true;
    };
    if (!can_read(archive.bytes())) {
      check_files();
      throw Error::failed("the disk cannot read all of the archive", archive_path_.string(),
                          "Copy the take to an intact disk with a tool that fills in unreadable "
                          "parts (ddrescue), and repair the copy");
    }
    try {
      VerifyOptions verify;
      verify.stop = options_.stop;
      const bool is_intact = verify_archive(pair_, verify).is_intact();
      if (options_.stop.stop_requested()) throw Cancelled{};
      if (!is_intact && !options_.dry_run && !is_writable) open_for_writing();  // throws
      if (!is_intact) {
        const CancellationScope scope(options_.stop);
        result.salvage = salvage_archive(pair_);
      }
      check_files();
      result.was_intact = is_intact;
      if (is_intact || options_.dry_run) return;
      replace(result, check_files);
      result.repaired = true;
    } catch (const Error&) {
      result.salvage = {};
      check_files();  // otherwise the error is what it found in zeros
      throw;
    }
  }

 private:
  template <class CheckFiles>
  void replace(RepairReport::Camera& result, const CheckFiles& check_files) {
    result.kept = replace_pair(pair_, {archive_path_, journal_path_}, result.salvage.frames,
                               !result.salvage.losses.empty(),
                               [&](const fs::path& archive, const fs::path& journal) {
                                 write_salvaged_archive(pair_, result.salvage, archive, journal);
                                 check_files();
                               });
  }

  const RepairOptions& options_;
  fs::path folder_;
  ArchivePair pair_;
  fs::path archive_path_, journal_path_;
};

// Renumbers a timeline that no longer matches the frame tables, or renames it: every reader would
// reject it.
void mend_timeline(const fs::path& folder, const std::optional<NumberedTimeline>& before,
                   RepairReport& report) {
  const fs::path file = folder / kTimelineFile;
  try {
    if (!exists(ContainedPath{folder, kTimelineFile})) return;
    read_timeline(Take(folder));
  } catch (const Error&) {
    report.is_timeline_renumbered = before && renumber_timeline(*before, folder);
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
  description.codec = header_of_pair(pair).codec;
  ArchiveWriter out(archive, journal, description);
  for (const FrameRecord& record : salvaged.records) {
    // Offset and size of a missing frame are 0.
    const auto bytes = pair.archive.subspan(static_cast<std::size_t>(record.offset), record.size);
    if (!is_temporal(description.codec) && read_frame_link(bytes)) {
      throw Error::failed(
          "the header is damaged so much that it does not say how the frames of "
          "video are to be decoded",
          pair.archive_name, "Restore the archive from a copy");
    }
    out.append_again(record, bytes);
  }
  out.close();
}

RepairReport repair_take(const fs::path& folder, const RepairOptions& options) {
  RepairReport report;
  std::optional<CopyOfTake> copy;
  if (options.copy) {
    copy.emplace(folder, *options.copy, options.stop);
    report.left_out = copy->left_out();
    report.files = copy->restore_documents(options.dry_run);
  }
  // In a dry run take.json may be missing still.
  const fs::path& described =
      copy && !copy->has_own_documents() && options.dry_run ? *options.copy : folder;
  const Take take(described);
  std::optional<NumberedTimeline> timeline;
  if (!options.dry_run) {
    const CancellationScope scope(options.stop);
    timeline = read_numbered_timeline(folder);
  }
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
        } catch (const Cancelled&) {
          return;
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
  if (copy) {
    const auto restored = copy->restore_derived(options.dry_run);
    report.files.insert(report.files.end(), restored.begin(), restored.end());
  }
  if (!options.dry_run && !report.failed()) mend_timeline(folder, timeline, report);
  return report;
}

}  // namespace raystage::store
