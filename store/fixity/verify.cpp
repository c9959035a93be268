// SPDX-License-Identifier: Apache-2.0
// Verifies all archives of a take (verify_archive.h), cameras in parallel, its timeline, its
// recording reports and the depth maps that were imported. Each file is mapped and read once.
#include "store/fixity/verify.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <iterator>
#include <mutex>
#include <optional>
#include <system_error>
#include <utility>

#include "base/contained_path.h"
#include "base/error.h"
#include "base/mapped_file.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "schemas/recording_document.h"
#include "store/fixity/undecodable_frames.h"
#include "store/fixity/verify_imported_depths.h"
#include "store/timeline.h"
#include "store/timeline_file.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;

std::uint64_t size_of(const fs::path& file) {
  std::error_code error;
  const auto size = fs::file_size(file, error);
  return error ? 0 : size;
}

// Only a recorder changes files; the size counted before may then be too small.
class Share {
 public:
  Share(std::uint64_t total, const std::function<void(double)>& report)
      : total_(std::max<std::uint64_t>(total, 1)), report_(report) {}
  void advance(std::uint64_t bytes) {
    if (!report_) return;
    const auto done = done_.fetch_add(bytes, std::memory_order_relaxed) + bytes;
    report_(std::min(1.0, static_cast<double>(done) / static_cast<double>(total_)));
  }

 private:
  std::uint64_t total_;
  const std::function<void(double)>& report_;
  std::atomic<std::uint64_t> done_ = 0;
};

/// Drops an archive from the page cache behind what is read, if it was not there before.
class CacheGuard {
 public:
  CacheGuard(const MappedFile& file, bool is_wanted)
      : file_(file), drops_(is_wanted && !file.is_mostly_cached()) {}
  CacheGuard(const CacheGuard&) = delete;
  CacheGuard& operator=(const CacheGuard&) = delete;
  ~CacheGuard() { drop(file_.bytes().size()); }
  void after(std::span<const std::byte> part) {
    const auto end = static_cast<std::size_t>(part.data() + part.size() - file_.bytes().data());
    if (end >= dropped_ + kReadPart) drop(end / kPage * kPage);
  }

 private:
  static constexpr std::size_t kPage = 65536;  // the page that is being read stays
  void drop(std::size_t end) {
    if (!drops_ || end <= dropped_) return;
    file_.uncache(file_.bytes().subspan(dropped_, end - dropped_));
    dropped_ = end;
  }
  const MappedFile& file_;
  bool drops_;
  std::size_t dropped_ = 0;
};

void verify_camera(const Take& take, int camera, const TakeVerifyOptions& options, Share& share,
                   TakeFixityReport::Camera& result) {
  const auto index = static_cast<std::size_t>(camera);
  const CheckedFrames checked =
      index < options.checked.size() ? options.checked[index] : CheckedFrames{};
  if (checked.is_complete) {
    result.report.status = RunStatus::kFinished;
    result.report.frames = checked.frames;
    share.advance(result.bytes);
    return;
  }
  ArchivePair pair = describe_pair(take, camera);
  try {
    if (!exists(take.file(pair.archive_name))) {
      result.report.problems.push_back(
          {pair.archive_name, 0, "the archive is missing: all of its frames are lost", {}, false});
      return;
    }
    const MappedFile archive(take.file(pair.archive_name));
    const bool everything = options.depth == VerifyDepth::kHashes || options.decode;
    archive.expect(everything ? MappedFile::Access::kSequential : MappedFile::Access::kSparse);
    std::optional<MappedFile> journal;
    const ContainedPath journal_file = take.file(pair.journal_name);
    if (exists(journal_file)) pair.journal = journal.emplace(journal_file).bytes();
    pair.archive = archive.bytes();
    VerifyOptions single;
    single.depth = options.depth;
    single.decode = options.decode;
    single.stop = options.stop;
    single.progress = [&](std::uint64_t bytes) { share.advance(bytes); };
    single.can_read = [&](std::span<const std::byte> part) { return archive.can_read(part); };
    single.checked_frames = checked.frames;
    if (options.on_checked) {
      single.on_intact_frames = [&](std::int64_t frames) {
        options.on_checked(camera, {frames, false});
      };
    }
    CacheGuard cache(archive, options.spares_page_cache);
    single.before_read = [&](std::span<const std::byte> part) {
      if (options.before_read) options.before_read(part.size());
    };
    single.after_read = [&](std::span<const std::byte> part) { cache.after(part); };
    const auto verify = [&] { return verify_archive(pair, single); };
    result.report = journal ? read_mapped(verify, archive, *journal) : read_mapped(verify, archive);
    if (options.on_checked && result.report.is_intact()) {
      options.on_checked(camera, {result.report.frames, true});
    }
  } catch (const Error& error) {
    result.error = error.what();
  }
}

/// Decodes the frames that refer to those of other cameras.
void decode_camera_groups(const Take& take, const TakeVerifyOptions& options,
                          TakeFixityReport& report) {
  struct Frame {
    Nanoseconds time;
    int camera, number;
  };
  std::vector<Frame> frames;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    try {
      const ArchiveReader& archive = take.archive(camera);
      if (!refers_to_cameras(archive.description().codec)) continue;
      for (int i = 0; i < static_cast<int>(archive.frames().size()); ++i) {
        frames.push_back({archive.frames()[i].time_ns, camera, i});
      }
    } catch (const Error& error) {  // which is a problem of the archive already
      if (error.exit_code() != ExitCode::kBadInput) throw;
    }
  }
  std::ranges::stable_sort(frames, {}, &Frame::time);  // groups are decoded once
  std::mutex mutex;
  parallel_for_in_order(
      frames.size(), static_cast<std::size_t>(tbb::this_task_arena::max_concurrency()),
      [&] { return options.stop.stop_requested(); },
      [&](std::size_t i) {
        const Frame& frame = frames[i];
        const ArchiveReader& archive = take.archive(frame.camera);
        // Frames that are damaged themselves are problems already.
        if (!archive.intact_stored(frame.number) || archive.intact_jpeg(frame.number)) return;
        const std::scoped_lock lock(mutex);
        const auto index = static_cast<std::size_t>(frame.camera);
        ArchiveFixityReport& found = report.cameras[index].report;
        if (found.problems.size() == kMaxProblems) {
          ++found.omitted_problems;
          return;
        }
        found.problems.push_back({take.document().cameras[index].archive,
                                  archive.frames()[frame.number].offset,
                                  "a frame cannot be decoded, or one of another camera that it "
                                  "refers to is damaged or lost",
                                  {{frame.number, frame.time}},
                                  false});
      });
}

/// Finds frames of video that refer to damaged or lost ones. Only damage or a repair makes them.
void verify_links(const Take& take, const std::stop_token& stop, TakeFixityReport& report) {
  FrameTimes damaged(report.cameras.size());
  bool may_lack_frames = false;
  for (std::size_t i = 0; i < damaged.size(); ++i) {
    may_lack_frames = may_lack_frames || report.cameras[i].report.has_gaps_in_video;
    for (const FixityProblem& problem : report.cameras[i].report.problems) {
      may_lack_frames = true;
      if (!problem.loses_frames) continue;
      for (const AffectedFrame& frame : problem.frames) damaged[i].insert(frame.time_ns);
    }
  }
  if (!may_lack_frames) return;
  try {
    auto undecodable = find_undecodable_frames(take, damaged, stop);
    for (std::size_t i = 0; i < undecodable.size(); ++i) {
      report.cameras[i].undecodable_frames = std::move(undecodable[i]);
    }
  } catch (const Error&) {  // an archive that cannot be read, which is a problem already
  }
}

void verify_timeline(const Take& take, TakeFixityReport& report) {
  try {
    if (exists(take.file(kTimelineFile))) read_timeline(take);
  } catch (const Error& error) {
    report.problems.push_back({std::string(kTimelineFile),
                               0,
                               error.what_happened() + ". " + error.what_to_do(),
                               {},
                               false});
  }
}

/// Checks the recording reports of the nodes, TAKE/recording/NODE.json.
void verify_recordings(const Take& take, TakeFixityReport& report) {
  const fs::path folder = take.folder() / "recording";
  const auto complain = [&](const fs::path& file, const std::string& what) {
    report.problems.push_back(
        {file.lexically_relative(take.folder()).string(), 0, what, {}, false});
  };
  std::error_code error;
  if (fs::symlink_status(folder, error).type() == fs::file_type::not_found) return;
  std::vector<fs::path> files;
  // Not a range-based for: its increment would throw.
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    if (entry->path().extension() == ".json") files.push_back(entry->path());
  }
  if (error) complain(folder, "the folder cannot be read: " + error.message());
  std::ranges::sort(files);
  for (const fs::path& file : files) {
    try {
      schemas::read_recording(take.file(file.lexically_relative(take.folder())));
    } catch (const Error& failure) {
      complain(file, failure.what_happened() +
                         "; no frame depends on this report, and it cannot be generated: "
                         "restore it from a copy");
    }
  }
}

}  // namespace

std::uint64_t TakeFixityReport::bytes() const {
  std::uint64_t sum = 0;
  for (const Camera& camera : cameras) sum += camera.bytes;
  return sum;
}

bool TakeFixityReport::is_intact() const {
  return problems.empty() && is_readable() && status == RunStatus::kFinished &&
         std::ranges::all_of(cameras, [](const Camera& c) { return c.report.is_intact(); });
}

bool TakeFixityReport::is_readable() const {
  return std::ranges::all_of(cameras, [](const Camera& c) { return c.error.empty(); });
}

ArchivePair describe_pair(const Take& take, int camera) {
  const auto index = static_cast<std::size_t>(camera);
  const auto& entry = take.document().cameras[index];
  const auto& model = take.rig().cameras[index].model;
  ArchivePair pair;
  pair.archive_name = entry.archive;
  pair.journal_name = entry.journal;
  pair.description = {entry.id, model.width(), model.height(), take.document().epoch_utc};
  return pair;
}

TakeFixityReport verify_take(const fs::path& folder, const TakeVerifyOptions& given) {
  const Stopwatch watch;
  TakeVerifyOptions options = given;
  if (options.decode) options.depth = VerifyDepth::kHashes;  // only this depth reads frames
  const Take take(folder);
  TakeFixityReport report;
  const auto cameras = static_cast<std::size_t>(take.camera_count());
  report.cameras.resize(cameras);
  for (std::size_t i = 0; i < cameras; ++i) {
    const auto& entry = take.document().cameras[i];
    report.cameras[i].id = entry.id;
    report.cameras[i].bytes =
        size_of(take.folder() / entry.archive) + size_of(take.folder() / entry.journal);
  }
  Share share(report.bytes(), options.progress);
  // One camera per thread, in order, so that a disk reads its files sequentially.
  const auto threads = static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
  parallel_for_in_order(
      cameras, threads, [&] { return options.stop.stop_requested(); },
      [&](std::size_t i) {
        verify_camera(take, static_cast<int>(i), options, share, report.cameras[i]);
      });
  if (options.decode) decode_camera_groups(take, options, report);
  if (options.depth == VerifyDepth::kHashes && !options.decode && !options.stop.stop_requested()) {
    verify_links(take, options.stop, report);
  }
  report.status = options.stop.stop_requested() ? RunStatus::kStopped : RunStatus::kFinished;
  // The timeline depends on the frame tables: it can be checked only if these are intact.
  if (report.status == RunStatus::kFinished && options.depth != VerifyDepth::kSizes &&
      report.is_intact()) {
    verify_timeline(take, report);
  }
  if (report.status == RunStatus::kFinished) {
    verify_recordings(take, report);
    std::ranges::move(verify_imported_depths(take, options), std::back_inserter(report.problems));
    if (options.stop.stop_requested()) report.status = RunStatus::kStopped;
  }
  if (options.progress && report.status == RunStatus::kFinished) options.progress(1);
  report.seconds = watch.seconds();
  return report;
}

}  // namespace raystage::store
