// SPDX-License-Identifier: Apache-2.0
// Packs and unpacks takes. Frames are processed in batches across cameras, in parallel within a
// batch, and appended in the order of their records. Input: a take; output: a new take of the same
// records. Cost: packing takes one encoding and one decoding of each frame by libjxl, unpacking one
// decoding.
#include "store/packing/pack_take.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <utility>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "schemas/rig_document.h"
#include "store/fixity/manifest.h"
#include "store/jpegxl/frame_packer.h"
#include "store/packing/copy_files.h"
#include "store/packing/whole_archives.h"
#include "store/timeline.h"
#include "store/timeline_file.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;

/// One record of a camera and, if it is stored, its number among the frames.
struct Job {
  int camera = 0;
  const FrameRecord* record = nullptr;
  int frame = -1;
};

std::vector<Job> jobs_of(const Take& take) {
  std::vector<Job> jobs;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    const ArchiveReader& archive = take.archive(camera);
    require_whole_archive(archive, take.document().cameras[camera].id, take.folder());
    int frame = 0;
    for (const FrameRecord& record : archive.records()) {
      const bool is_stored = record.status == FrameStatus::kStored;
      jobs.push_back({camera, &record, is_stored ? frame++ : -1});
    }
  }
  return jobs;
}

/// The document of the new take: the same, but all archives count from the take's epoch.
schemas::TakeDocument repacked_document(schemas::TakeDocument document) {
  for (schemas::TakeDocument::Camera& camera : document.cameras) camera.archive_epoch_utc = {};
  return document;
}

class Repacker {
 public:
  Repacker(const Take& take, const fs::path& folder, FrameCodec codec, const PackOptions& options)
      : take_(take),
        options_(options),
        folder_(folder),
        codec_(codec),
        jobs_(jobs_of(take)),
        writer_(folder, repacked_document(take.document()),
                schemas::read_rig(take.file("rig.json")), codec) {
    for (const auto& camera : take.document().cameras) {
      report_.cameras.emplace_back().id = camera.id;
    }
  }

  PackReport run() {
    const Stopwatch watch;
    for (std::size_t begin = 0; begin < jobs_.size();) begin = run_batch(begin);
    // A camera without records has files, too: finish() makes them.
    writer_.finish();
    report_.seconds = watch.seconds();
    copy_other_files(take_.folder(), writer_.working_folder(),
                     codec_ == FrameCodec::kPacked ? Direction::kPack : Direction::kUnpack);
    rewrite_timeline();
    writer_.commit();
    report_.thread_seconds = static_cast<double>(nanoseconds_) / 1e9;
    report_.status = RunStatus::kFinished;
    return std::move(report_);
  }

 private:
  static constexpr std::uint64_t kMaxBatchBytes = std::uint64_t{128} << 20;

  /// A timeline states the frame tables that it was made from, with the sizes of stored frames.
  void rewrite_timeline() const {
    if (!file_exists(writer_.working_folder() / kTimelineFile)) return;
    try {
      write_timeline(read_timeline(take_), writer_.working_folder());
    } catch (const Error& error) {
      if (error.exit_code() != ExitCode::kBadInput) throw;
      // It is of other frames in the source, too, and remains so.
    }
  }

  void require_not_stopped() const {
    if (!options_.stop.stop_requested()) return;
    throw Error::failed(
        codec_ == FrameCodec::kPacked ? "packing was stopped" : "unpacking was stopped",
        folder_.string(), "Start it again; no files remain");
  }

  /// Packs a batch that begins with a job, appends its frames, and returns the next job.
  std::size_t run_batch(std::size_t begin) {
    const auto threads = static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
    const std::size_t most = 16 * threads;
    std::size_t end = begin;
    std::uint64_t bytes = 0;
    while (end < jobs_.size() && end - begin < most && (end == begin || bytes < kMaxBatchBytes)) {
      bytes += jobs_[end++].record->size;
    }
    std::vector<FramePacker::Packed> frames(end - begin);
    std::vector<FrameBytes> jpegs(end - begin);
    std::atomic<std::size_t> next = begin;
    parallel_for(std::size_t{0}, std::min(threads, end - begin), [&](std::size_t) {
      for (std::size_t job = next++; job < end && !options_.stop.stop_requested(); job = next++) {
        transform(jobs_[job], jpegs[job - begin], frames[job - begin]);
      }
    });
    require_not_stopped();
    for (std::size_t job = begin; job < end; ++job) {
      append(jobs_[job], jpegs[job - begin], frames[job - begin]);
    }
    if (options_.progress) {
      options_.progress(static_cast<double>(end) / static_cast<double>(jobs_.size()));
    }
    return end;
  }

  bool has_pictures(int camera) const {
    return take_.archive(camera).description().codec == FrameCodec::kPicture;
  }

  void transform(const Job& job, FrameBytes& jpeg, FramePacker::Packed& packed) {
    if (job.frame < 0) return;
    const auto start = std::chrono::steady_clock::now();
    const ArchiveReader& archive = take_.archive(job.camera);
    if (has_pictures(job.camera)) {
      jpeg = archive.stored(job.frame);
      packed.refusal = "pictures of more than 8 bits are JPEG XL already";
      return;
    }
    jpeg = archive.jpeg(job.frame);
    if (codec_ == FrameCodec::kPacked) {
      const ArchiveWriter::Description& camera = archive.description();
      packed = packer_.pack(jpeg, {camera.width, camera.height}, options_.effort,
                            take_.folder() / take_.document().cameras[job.camera].archive);
    }
    nanoseconds_ += std::chrono::duration_cast<std::chrono::nanoseconds>(
                        std::chrono::steady_clock::now() - start)
                        .count();
  }

  void append(const Job& job, const FrameBytes& jpeg, const FramePacker::Packed& packed) {
    ArchiveWriter& to = writer_.archive(job.camera);
    PackReport::Camera& camera = report_.cameras[static_cast<std::size_t>(job.camera)];
    if (job.frame < 0) {
      to.append_again(*job.record, {});
    } else {
      const std::span<const std::byte> stored =
          packed.bytes.empty() ? jpeg.bytes() : std::span<const std::byte>(packed.bytes);
      to.append_again(*job.record, stored);
      ++camera.frames;
      camera.bytes_before += job.record->size;
      camera.bytes_after += stored.size();
      const bool is_packed = codec_ == FrameCodec::kPacked
                                 ? !packed.bytes.empty()
                                 : take_.archive(job.camera).is_packed(job.frame);
      camera.packed += is_packed ? 1 : 0;
      if (!packed.refusal.empty()) ++camera.refusals[packed.refusal];
    }
    const Job* const following = &job + 1;
    if (following == jobs_.data() + jobs_.size() || following->camera != job.camera) to.close();
  }

  const Take& take_;
  const PackOptions& options_;
  const fs::path folder_;
  const FrameCodec codec_;
  const std::vector<Job> jobs_;
  TakeWriter writer_;
  FramePacker packer_;
  std::atomic<std::int64_t> nanoseconds_ = 0;
  PackReport report_;
};

PackReport repack(const Take& take, const fs::path& folder, FrameCodec codec,
                  const PackOptions& options) {
  take.check_not_inside(folder);
  files_of_take(take.folder());  // refuse what cannot be copied before the long part
  return Repacker(take, folder, codec, options).run();
}

}  // namespace

PackReport::Camera PackReport::total() const {
  Camera sum;
  for (const Camera& camera : cameras) {
    sum.frames += camera.frames;
    sum.packed += camera.packed;
    sum.bytes_before += camera.bytes_before;
    sum.bytes_after += camera.bytes_after;
    for (const auto& [why, count] : camera.refusals) sum.refusals[why] += count;
  }
  return sum;
}

PackReport pack_take(const Take& take, const fs::path& folder, const PackOptions& options) {
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    if (is_temporal(take.archive(camera).description().codec)) {
      throw Error::bad_input("the frames of the take are HEVC or AV1, not JPEG",
                             take.folder().string(), "Pack the take that they were made from");
    }
  }
  return repack(take, folder, FrameCodec::kPacked, options);
}

PackReport unpack_take(const Take& take, const fs::path& folder, const PackOptions& options) {
  bool is_packed = false, has_jpegs = false;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    if (is_temporal(take.archive(camera).description().codec)) {
      throw Error::bad_input(
          "the frames of the take are HEVC or AV1: the JPEGs that they were made "
          "from are not in it",
          take.folder().string(),
          "Use the take as it is; `raystage export images` writes its pictures");
    }
    const FrameCodec codec = take.archive(camera).description().codec;
    is_packed = is_packed || codec == FrameCodec::kPacked;
    has_jpegs = has_jpegs || codec == FrameCodec::kJpeg;
  }
  if (!is_packed) {
    throw Error::bad_input("the take is not packed", take.folder().string(),
                           has_jpegs ? "Its frames are JPEG already: use it as it is"
                                     : "Its frames are JPEG XL pictures of more than 8 bits, as "
                                       "they were recorded: use it as it is");
  }
  return repack(take, folder, FrameCodec::kJpeg, options);
}

}  // namespace raystage::store
