// SPDX-License-Identifier: Apache-2.0
// Encodes takes as video. Cameras are encoded in parallel, each as one sequence of pictures whose
// groups begin with key frames. Across cameras, the frames of an instant are such a sequence
// (camera_order.h). The frames then get the records of the source, with its times and gaps between
// them. Input: a take; output: a new take of the same records. Cost: one encoding by
// the codec, one decoding of each frame by it and two as JPEG.
#include "store/packing/pack_temporal.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <utility>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "schemas/rig_document.h"
#include "store/fixity/manifest.h"
#include "store/packing/camera_order.h"
#include "store/packing/copy_files.h"
#include "store/packing/sequence_encoder.h"
#include "store/packing/whole_archives.h"
#include "store/timeline.h"
#include "store/timeline_file.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;

double psnr_of(double mean_square_error) {
  if (mean_square_error <= 0) return std::numeric_limits<double>::infinity();
  return 10 * std::log10(255.0 * 255.0 / mean_square_error);
}

FrameCodec codec_of(const VideoSettings& video, References references) {
  const bool is_hevc = video.codec == VideoCodec::kHevc;
  if (references == References::kTime) return is_hevc ? FrameCodec::kHevc : FrameCodec::kAv1;
  return is_hevc ? FrameCodec::kHevcCameras : FrameCodec::kAv1Cameras;
}

schemas::TakeDocument encoded_document(schemas::TakeDocument document) {
  for (schemas::TakeDocument::Camera& camera : document.cameras) camera.archive_epoch_utc = {};
  return document;
}

class TakeEncoder {
 public:
  /// `codec`: of the new take; JPEG: decoded frames are stored.
  TakeEncoder(const Take& take, const fs::path& folder, const Excerpt& excerpt, FrameCodec codec,
              const std::stop_token& stop)
      : take_(take),
        excerpt_(excerpt),
        encoder_(take, folder, excerpt.video.value_or(VideoSettings{}), codec == FrameCodec::kJpeg,
                 stop),
        writer_(folder, encoded_document(take.document()), schemas::read_rig(take.file("rig.json")),
                codec),
        positions_(static_cast<std::size_t>(take.camera_count())) {
    if (take.document().has_deep_pixels()) {
      throw Error::bad_input("frames of more than 8 bits would be rounded and clipped at white",
                             take.folder().string(), "Pack the take without --temporal");
    }
    for (int camera = 0; camera < take.camera_count(); ++camera) {
      const std::string& id = take.document().cameras[camera].id;
      require_whole_archive(take.archive(camera), id, take.folder());
      if (is_temporal(take.archive(camera).description().codec)) {
        throw Error::bad_input("the frames of the take are HEVC or AV1 already",
                               take.folder().string(),
                               "Pack the take that they were made from: each encoding loses more");
      }
      report_.cameras.emplace_back().id = id;
      wanted_frames_ +=
          std::ranges::count_if(take.archive(camera).frames(),
                                [&](const FrameRecord& frame) { return is_wanted(frame.time_ns); });
    }
  }

  TakeWriter& writer() { return writer_; }

  void encode_all(const std::function<void(double)>& progress) {
    const Stopwatch watch;
    const bool is_across = excerpt_.references == References::kCameras;
    std::vector<int> together, alone;
    for (const int camera : serpentine_order(take_.rig())) {
      (is_across && is_encoded(camera) ? together : alone).push_back(camera);
    }
    progress_ = progress;
    parallel_for_each(alone.size(), [&](std::size_t i) { encode_camera(alone[i]); });
    encode_instants(together);
    writer_.finish();
    report_.seconds = watch.seconds();
    report_.encode_thread_seconds = encoder_.encode_thread_seconds();
    report_.decode_thread_seconds = encoder_.decode_thread_seconds();
    report_.status = RunStatus::kFinished;
  }

  TemporalReport take_report() { return std::move(report_); }

 private:
  /// How far the records of a camera are appended.
  struct Position {
    std::size_t record = 0;
    int frame = 0;
  };

  template <class Body>
  static void parallel_for_each(std::size_t count, const Body& body) {
    const auto threads = static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
    parallel_for_in_order(
        count, threads, [] { return false; }, body);
  }

  bool is_wanted(Nanoseconds time) const { return time >= excerpt_.first && time <= excerpt_.last; }

  bool is_encoded(int camera) const {
    return excerpt_.video && std::ranges::find(excerpt_.unencoded_cameras, camera) ==
                                 excerpt_.unencoded_cameras.end();
  }

  void encode_camera(int camera) {
    const ArchiveReader& archive = take_.archive(camera);
    Sequence sequence;
    const auto encode_and_append = [&] {
      if (is_encoded(camera) && !sequence.frames.empty()) encoder_.encode(sequence);
      append(sequence);
      sequence = {};
    };
    for (int i = 0; i < static_cast<int>(archive.frames().size()); ++i) {
      if (!is_wanted(archive.frames()[i].time_ns)) continue;
      sequence.frames.push_back({camera, i});
      if (sequence.frames.size() == frames_at_once()) encode_and_append();
    }
    encode_and_append();
    finish(camera);
  }

  /// Returns how many frames are encoded before they are written: whole groups.
  std::size_t frames_at_once() const {
    const int group = std::max(1, excerpt_.video.value_or(VideoSettings{}).group_frames);
    const int groups = std::max(1, (excerpt_.frames_at_once + group - 1) / group);
    return static_cast<std::size_t>(groups) * static_cast<std::size_t>(group);
  }

  /// Encodes the instants of cameras in parallel, as many at once as there are threads, and appends
  /// them in order. Cameras of other sizes are other sequences.
  void encode_instants(std::vector<int> cameras) {
    const auto size_of = [&](int camera) {
      const auto& model = take_.rig().cameras[static_cast<std::size_t>(camera)].model;
      return std::pair(model.width(), model.height());
    };
    std::ranges::stable_sort(cameras, {}, size_of);
    for (auto begin = cameras.begin(); begin != cameras.end();) {
      const auto end = std::find_if(begin, cameras.end(),
                                    [&](int camera) { return size_of(camera) != size_of(*begin); });
      const std::vector<int> alike(begin, end);
      const auto instants = frames_by_instant(take_, alike, excerpt_.first, excerpt_.last);
      const auto batch = static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
      for (std::size_t first = 0; first < instants.size(); first += batch) {
        std::vector<Sequence> sequences(std::min(batch, instants.size() - first));
        parallel_for_each(sequences.size(), [&](std::size_t i) {
          sequences[i].frames = instants[first + i];
          encoder_.encode(sequences[i]);
        });
        for (const Sequence& sequence : sequences) append(sequence);
      }
      for (const int camera : alike) finish(camera);
      begin = end;
    }
  }

  /// Appends the frames of a sequence, those of a camera in order. Threads may append frames of
  /// different cameras.
  void append(const Sequence& sequence) {
    for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
      const auto [camera, frame] = sequence.frames[i];
      const FrameRecord& record = *append_gaps(camera, frame);
      TemporalReport::Camera& report = report_.cameras[static_cast<std::size_t>(camera)];
      FrameBytes jpeg;
      std::span<const std::byte> stored;
      if (sequence.stored.empty()) {
        jpeg = take_.archive(camera).jpeg(frame);
        stored = jpeg;
      } else {
        stored = sequence.decoded.empty() ? sequence.stored[i] : sequence.decoded[i];
        report.groups += is_key_frame(sequence.stored[i]) ? 1 : 0;
        report.frames_in_444 += sequence.chroma == ChromaStep::k444 ? 1 : 0;
        // The mean of those so far; append() is the only one to change it.
        report.mean_square_error += (sequence.errors[i] - report.mean_square_error) /
                                    static_cast<double>(report.frames + 1);
        const double psnr = psnr_of(sequence.errors[i]);
        report.min_psnr_db = report.frames == 0 ? psnr : std::min(report.min_psnr_db, psnr);
      }
      writer_.archive(camera).append_again(record, stored);
      ++report.frames;
      report.bytes_before += record.size;
      report.bytes_after += stored.size();
    }
    const std::int64_t done = appended_frames_ += static_cast<std::int64_t>(sequence.frames.size());
    if (progress_ && wanted_frames_ > 0) {
      progress_(static_cast<double>(done) / static_cast<double>(wanted_frames_));
    }
  }

  void finish(int camera) {
    append_gaps(camera, std::numeric_limits<int>::max());
    writer_.archive(camera).close();
  }

  /// Appends the records of missing frames before a frame. Returns the frame's record; null after
  /// the last.
  const FrameRecord* append_gaps(int camera, int frame) {
    Position& position = positions_[static_cast<std::size_t>(camera)];
    const std::span<const FrameRecord> records = take_.archive(camera).records();
    while (position.record < records.size()) {
      const FrameRecord& record = records[position.record++];
      const bool is_stored = record.status == FrameStatus::kStored;
      if (is_stored && position.frame++ == frame) return &record;
      if (!is_stored && is_wanted(record.time_ns)) writer_.archive(camera).append_again(record, {});
    }
    return nullptr;
  }

  const Take& take_;
  const Excerpt excerpt_;
  SequenceEncoder encoder_;
  TakeWriter writer_;
  std::vector<Position> positions_;  // of each camera
  std::int64_t wanted_frames_ = 0;
  std::atomic<std::int64_t> appended_frames_ = 0;
  std::function<void(double)> progress_;
  TemporalReport report_;
};

/// A timeline states the frame tables that it was made from, with the sizes of stored frames.
void rewrite_timeline_of(const Take& take, const fs::path& folder) {
  if (!file_exists(folder / kTimelineFile)) return;
  try {
    write_timeline(read_timeline(take), folder);
  } catch (const Error& error) {
    if (error.exit_code() != ExitCode::kBadInput) throw;
    // It is of other frames in the source, too, and remains so.
  }
}

}  // namespace

TemporalReport::Camera TemporalReport::total() const {
  Camera sum;
  double squares = 0;
  sum.min_psnr_db = std::numeric_limits<double>::infinity();
  for (const Camera& camera : cameras) {
    sum.frames += camera.frames;
    sum.groups += camera.groups;
    sum.frames_in_444 += camera.frames_in_444;
    sum.bytes_before += camera.bytes_before;
    sum.bytes_after += camera.bytes_after;
    squares += camera.mean_square_error * static_cast<double>(camera.frames);
    if (camera.frames > 0) sum.min_psnr_db = std::min(sum.min_psnr_db, camera.min_psnr_db);
  }
  if (sum.frames > 0) sum.mean_square_error = squares / static_cast<double>(sum.frames);
  return sum;
}

double TemporalReport::psnr_db() const { return psnr_of(total().mean_square_error); }

void require_new_take(const Take& take, const fs::path& folder) {
  take.check_not_inside(folder);
  files_of_take(take.folder());
  TakeWriter::require_absent(folder);
}

TemporalReport pack_temporal(const Take& take, const fs::path& folder,
                             const TemporalOptions& options) {
  require_new_take(take, folder);
  Excerpt everything;
  everything.first = std::numeric_limits<Nanoseconds>::min();
  everything.last = std::numeric_limits<Nanoseconds>::max();
  everything.video = options.video;
  everything.references = options.references;
  everything.frames_at_once = options.frames_at_once;
  TakeEncoder encoder(take, folder, everything, codec_of(options.video, options.references),
                      options.stop);
  encoder.encode_all(options.progress);
  const fs::path& working = encoder.writer().working_folder();
  copy_other_files(take.folder(), working, Direction::kPack);
  rewrite_timeline_of(take, working);
  encoder.writer().commit();
  return encoder.take_report();
}

void write_excerpt(const Take& take, const fs::path& folder, const Excerpt& excerpt,
                   const std::stop_token& stop) {
  take.check_not_inside(folder);
  TakeEncoder encoder(take, folder, excerpt, FrameCodec::kJpeg, stop);
  encoder.encode_all({});
  encoder.writer().commit();
}

}  // namespace raystage::store
