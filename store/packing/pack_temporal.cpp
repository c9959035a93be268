// SPDX-License-Identifier: Apache-2.0
// Encodes takes as video. Cameras are encoded in parallel, each as one sequence of pictures whose
// groups begin with key frames; the frames then get the records of the source, with its times and
// gaps between them. Input: a take; output: a new take of the same records. Cost: one encoding by
// the codec, one decoding of each frame by it and two as JPEG.
#include "store/packing/pack_temporal.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "schemas/rig_document.h"
#include "store/fixity/manifest.h"
#include "store/jpegxl/packed_frame.h"
#include "store/packing/copy_files.h"
#include "store/packing/whole_archives.h"
#include "store/temporal/group_decoder.h"
#include "store/timeline.h"
#include "store/timeline_file.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;

double psnr_of(double mean_square_error) {
  if (mean_square_error <= 0) return std::numeric_limits<double>::infinity();
  return 10 * std::log10(255.0 * 255.0 / mean_square_error);
}

FrameCodec codec_of(const VideoSettings& video) {
  return video.codec == VideoCodec::kHevc ? FrameCodec::kHevc : FrameCodec::kAv1;
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
        folder_(folder),
        excerpt_(excerpt),
        codec_(codec),
        stop_(stop),
        writer_(folder, encoded_document(take.document()), schemas::read_rig(take.file("rig.json")),
                codec) {
    for (int camera = 0; camera < take.camera_count(); ++camera) {
      const std::string& id = take.document().cameras[camera].id;
      require_whole_archive(take.archive(camera), id, take.folder());
      if (is_temporal(take.archive(camera).description().codec)) {
        throw Error::bad_input("the frames of the take are HEVC or AV1 already",
                               take.folder().string(),
                               "Pack the take that they were made from: each encoding loses more");
      }
      report_.cameras.emplace_back().id = id;
    }
  }

  TakeWriter& writer() { return writer_; }

  void encode_all(const std::function<void(double)>& progress) {
    const Stopwatch watch;
    const int cameras = take_.camera_count();
    const int threads = std::min(tbb::this_task_arena::max_concurrency(), cameras);
    std::atomic<int> next = 0, done = 0;
    parallel_for(0, threads, [&](int) {
      for (int camera = next++; camera < cameras; camera = next++) {
        encode_camera(camera);
        if (progress) progress(static_cast<double>(++done) / cameras);
      }
    });
    writer_.finish();
    report_.seconds = watch.seconds();
    report_.encode_thread_seconds = static_cast<double>(encode_us_) / 1e6;
    report_.decode_thread_seconds = static_cast<double>(decode_us_) / 1e6;
    report_.status = RunStatus::kFinished;
  }

  TemporalReport take_report() { return std::move(report_); }

 private:
  /// Frames of a camera in the excerpt, and what was made of them, if they are encoded.
  struct Sequence {
    std::vector<int> frames;
    std::vector<std::vector<std::byte>> stored, decoded;
  };

  bool is_wanted(Nanoseconds time) const { return time >= excerpt_.first && time <= excerpt_.last; }

  void require_not_stopped() const {
    if (!stop_.stop_requested()) return;
    throw Error::failed("packing was stopped", folder_.string(), "Start it again; no files remain");
  }

  Planes planes_of(int camera, int frame, JpegFixity* fixity) const {
    const ArchiveReader& archive = take_.archive(camera);
    const FrameBytes jpeg = archive.jpeg(frame);
    if (fixity != nullptr) *fixity = fixity_of(jpeg);
    const ArchiveWriter::Description& description = archive.description();
    return planes_of_jpeg(
        jpeg, description.width, description.height,
        "frame " + std::to_string(frame) + " of camera \"" + description.camera_id + "\"");
  }

  void encode_camera(int camera) {
    const ArchiveReader& archive = take_.archive(camera);
    Sequence sequence;
    for (int i = 0; i < static_cast<int>(archive.frames().size()); ++i) {
      if (is_wanted(archive.frames()[i].time_ns)) sequence.frames.push_back(i);
    }
    const bool is_encoded =
        excerpt_.video &&
        std::ranges::find(excerpt_.unencoded_cameras, camera) == excerpt_.unencoded_cameras.end();
    if (is_encoded && !sequence.frames.empty()) {
      const Stopwatch encoding;
      encode(camera, sequence);
      encode_us_ += std::llround(encoding.seconds() * 1e6);
      const Stopwatch decoding;
      compare(camera, sequence);
      decode_us_ += std::llround(decoding.seconds() * 1e6);
    }
    append(camera, sequence);
  }

  void encode(int camera, Sequence& sequence) {
    VideoEncoder encoder(*excerpt_.video);
    std::vector<JpegFixity> sources;
    for (const int frame : sequence.frames) {
      require_not_stopped();
      encoder.push(planes_of(camera, frame, &sources.emplace_back()));
    }
    FrameLink link;
    for (const VideoPacket& packet : encoder.finish()) {
      const std::size_t i = sequence.stored.size();
      if (packet.is_key) link = {};
      if (link.position >= kMaxGroupFrames) {
        throw Error::failed("the encoder made a group of too many frames", folder_.string(),
                            "Use shorter groups");
      }
      link.source_bytes = sources[i].size;
      link.source_xxh3 = sources[i].xxh3;
      sequence.stored.push_back(make_temporal_frame(excerpt_.video->codec, link, packet.bytes));
      ++link.position;
      link.previous = hash_of_stored(sequence.stored.back());
    }
  }

  /// Decodes the groups as readers do and compares the pictures with their sources.
  void compare(int camera, Sequence& sequence) {
    const ArchiveWriter::Description& description = take_.archive(camera).description();
    const int width = description.width, height = description.height;
    TemporalReport::Camera& report = report_.cameras[static_cast<std::size_t>(camera)];
    double sum = 0, worst = 0;
    for (std::size_t begin = 0; begin < sequence.stored.size();) {
      require_not_stopped();
      std::vector<std::span<const std::byte>> group{sequence.stored[begin]};
      while (begin + group.size() < sequence.stored.size() &&
             !is_key_frame(sequence.stored[begin + group.size()])) {
        group.emplace_back(sequence.stored[begin + group.size()]);
      }
      auto jpegs = decoder_.decode(excerpt_.video->codec, {width, height}, group, folder_);
      for (std::size_t i = 0; i < jpegs.size(); ++i) {
        const Planes decoded = planes_of_jpeg(jpegs[i], width, height, "a decoded frame");
        const Planes source = planes_of(camera, sequence.frames[begin + i], nullptr);
        const double error = mean_square_error(source, decoded, width, height);
        sum += error;
        worst = std::max(worst, error);
      }
      begin += group.size();
      ++report.groups;
      if (codec_ == FrameCodec::kJpeg) {
        std::ranges::move(jpegs, std::back_inserter(sequence.decoded));
      }
    }
    report.mean_square_error = sum / static_cast<double>(sequence.stored.size());
    report.min_psnr_db = psnr_of(worst);
  }

  void append(int camera, const Sequence& sequence) {
    const ArchiveReader& archive = take_.archive(camera);
    TemporalReport::Camera& report = report_.cameras[static_cast<std::size_t>(camera)];
    ArchiveWriter& to = writer_.archive(camera);
    std::size_t next = 0;
    for (const FrameRecord& record : archive.records()) {
      if (!is_wanted(record.time_ns)) continue;
      if (record.status != FrameStatus::kStored) {
        to.append_again(record, {});
        continue;
      }
      FrameBytes jpeg;
      std::span<const std::byte> stored;
      if (!sequence.stored.empty()) {
        stored = codec_ == FrameCodec::kJpeg ? sequence.decoded[next] : sequence.stored[next];
      } else {
        jpeg = archive.jpeg(sequence.frames[next]);
        stored = jpeg;
      }
      ++next;
      to.append_again(record, stored);
      ++report.frames;
      report.bytes_before += record.size;
      report.bytes_after += stored.size();
    }
    to.close();
  }

  const Take& take_;
  const fs::path folder_;
  const Excerpt excerpt_;
  const FrameCodec codec_;
  const std::stop_token stop_;
  TakeWriter writer_;
  GroupDecoder decoder_;
  std::atomic<std::int64_t> encode_us_ = 0, decode_us_ = 0;
  TemporalReport report_;
};

/// A timeline states the frame tables that it was made from, with the sizes of stored frames.
void rewrite_timeline_of(const Take& take, const fs::path& folder) {
  if (!fs::exists(folder / kTimelineFile)) return;
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
    sum.bytes_before += camera.bytes_before;
    sum.bytes_after += camera.bytes_after;
    squares += camera.mean_square_error * static_cast<double>(camera.frames);
    if (camera.frames > 0) sum.min_psnr_db = std::min(sum.min_psnr_db, camera.min_psnr_db);
  }
  if (sum.frames > 0) sum.mean_square_error = squares / static_cast<double>(sum.frames);
  return sum;
}

double TemporalReport::psnr_db() const { return psnr_of(total().mean_square_error); }

TemporalReport pack_temporal(const Take& take, const fs::path& folder,
                             const TemporalOptions& options) {
  take.check_not_inside(folder);
  files_of_take(take.folder());  // refuse what cannot be copied before the long part
  Excerpt everything;
  everything.first = std::numeric_limits<Nanoseconds>::min();
  everything.last = std::numeric_limits<Nanoseconds>::max();
  everything.video = options.video;
  TakeEncoder encoder(take, folder, everything, codec_of(options.video), options.stop);
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
