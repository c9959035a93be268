// SPDX-License-Identifier: Apache-2.0
// Imports images and movies as a take. JPEG is stored byte for byte or with added restart markers;
// other formats are encoded: as JPEG, or, with more than 8 bits, as JPEG XL pictures. Cameras run
// in parallel, each with one frame in memory.
#include "ingest/import_take.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <atomic>
#include <cmath>
#include <span>
#include <system_error>
#include <utility>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/options.h"
#include "base/parallel.h"
#include "ingest/deep_source.h"
#include "ingest/movie_reader.h"
#include "ingest/source_image.h"
#include "store/jpeg/layout.h"
#include "store/jpegxl/picture_codec.h"
#include "store/take.h"

namespace raystage::ingest {
namespace {

bool is_jpeg(std::span<const std::byte> bytes) {
  return bytes.size() >= 2 && bytes[0] == std::byte{0xFF} && bytes[1] == std::byte{0xD8};
}

/// Returns the number of frames that is known before the import: 0 for a movie without times.
std::int64_t frames_of(const schemas::ImportManifest::Camera& camera) {
  return static_cast<std::int64_t>(camera.movie.empty() ? camera.frames.size()
                                                        : camera.times_ns.size());
}

/// Throws Error (failed) if this process may not have the archives and journals of all cameras
/// open at once.
void require_open_files(std::size_t cameras) {
  constexpr rlim_t kOthers = 128;  // pictures, libraries, decoders
  rlimit limit{};
  const rlim_t needed = 2 * cameras + kOthers;
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur >= needed) return;
  throw Error::failed(fmt::format("{} cameras need up to {} open files, allowed here: {}", cameras,
                                  needed, limit.rlim_cur),
                      "", "Raise the limit (`ulimit -n`), or import fewer cameras");
}

class Importer {
 public:
  Importer(const schemas::ImportManifest& manifest, const std::filesystem::path& base,
           const ImportOptions& options, std::stop_token stop)
      : manifest_(manifest), base_(base), options_(options), stop_(std::move(stop)) {
    for (const auto& camera : manifest.cameras) {
      const std::int64_t frames = frames_of(camera);
      total_ += frames;
      all_counted_ = all_counted_ && frames > 0;
    }
  }

  void check_files() const;
  /// Returns the encoding of each camera's pictures of more than 8 bits; nullopt: it has JPEG.
  std::vector<std::optional<schemas::PixelEncoding>> encodings() const;
  /// Returns the brightest light of the camera's pictures of more than 8 bits.
  double import_camera(const schemas::ImportManifest::Camera& camera,
                       const std::optional<schemas::PixelEncoding>& encoding,
                       store::ArchiveWriter& archive, const ParallelLoop& loop);
  ImportSummary summary() const;

 private:
  struct Target {
    const schemas::CameraGeometry& geometry;
    const std::optional<schemas::PixelEncoding>& encoding;  // of pictures of more than 8 bits
    store::ArchiveWriter& archive;
    const ParallelLoop& loop;  // over all cameras
    double& peak;              // brightest light so far
    SourceImageSize size() const { return {geometry.width, geometry.height}; }
  };

  bool linear() const { return manifest_.color_space == "lin_rec709_scene"; }
  void import_file(const schemas::ImportManifest::Frame& frame, const Target& target);
  void import_movie(const schemas::ImportManifest::Camera& camera, const Target& target);
  void append_jpeg(std::span<const std::byte> jpeg, Nanoseconds time, const Target& target,
                   const std::string& name);
  void append_image(const store::RgbImage& image, Nanoseconds time, const Target& target);
  void append_deep(const DeepSource& source, Nanoseconds time, const Target& target,
                   const std::string& name);
  void append(std::span<const std::byte> jpeg, Nanoseconds time, const Target& target);
  Nanoseconds time_of(const schemas::ImportManifest::Camera& camera, std::size_t frame) const;
  void report_progress(std::int64_t done, std::int64_t total) const;
  void stop_if_asked(const Target& target) const;

  const schemas::ImportManifest& manifest_;
  const std::filesystem::path& base_;
  const ImportOptions& options_;
  const std::stop_token stop_;
  const images::ImageReader reader_;
  const images::ExrReader exr_reader_;
  const store::PictureCodec codec_;
  std::int64_t total_ = 0;
  bool all_counted_ = true;  // false: progress counts cameras instead of frames
  std::atomic<std::int64_t> copied_ = 0, rewritten_ = 0, encoded_ = 0, deep_ = 0, not_finite_ = 0,
                            done_ = 0, cameras_done_ = 0;
  std::atomic<std::uint64_t> jpeg_bytes_ = 0;
};

/// Reports a missing file before the first frame is written, not an hour later.
void Importer::check_files() const {
  const auto check = [&](const std::string& file, const std::string& camera) {
    const std::filesystem::path path = base_ / file;
    std::error_code error;
    if (std::filesystem::is_regular_file(path, error)) return;
    const bool exists = std::filesystem::exists(path, error);
    throw Error::bad_input(
        fmt::format("the file of camera \"{}\" {}", camera,
                    exists ? "is a folder, a pipe or a device" : "was not found"),
        path.string(),
        "Correct the path in the manifest (relative to its folder), or restore the file");
  };
  for (const schemas::ImportManifest::Camera& camera : manifest_.cameras) {
    if (!camera.movie.empty()) check(camera.movie, camera.geometry.id);
    for (const auto& frame : camera.frames) check(frame.file, camera.geometry.id);
  }
}

std::vector<std::optional<schemas::PixelEncoding>> Importer::encodings() const {
  std::vector<std::optional<schemas::PixelEncoding>> result(manifest_.cameras.size());
  if (!options_.keep_depth) return result;
  raystage::parallel_for(std::size_t{0}, result.size(), [&](std::size_t i) {
    const schemas::ImportManifest::Camera& camera = manifest_.cameras[i];
    result[i] =
        camera.movie.empty()
            ? deep_encoding_of_image(reader_, exr_reader_, base_ / camera.frames[0].file, linear())
            : deep_encoding_of_movie(MovieReader(base_ / camera.movie).format());
  });
  return result;
}

double Importer::import_camera(const schemas::ImportManifest::Camera& camera,
                               const std::optional<schemas::PixelEncoding>& encoding,
                               store::ArchiveWriter& archive, const ParallelLoop& loop) {
  double peak = 0;
  const Target target{camera.geometry, encoding, archive, loop, peak};
  if (!camera.movie.empty()) import_movie(camera, target);
  for (const schemas::ImportManifest::Frame& frame : camera.frames) {
    stop_if_asked(target);
    import_file(frame, target);
  }
  const std::int64_t done = ++cameras_done_;
  if (!all_counted_) report_progress(done, static_cast<std::int64_t>(manifest_.cameras.size()));
  return peak;
}

/// Returns the time of a movie's frame.
Nanoseconds Importer::time_of(const schemas::ImportManifest::Camera& camera,
                              std::size_t frame) const {
  if (!camera.times_ns.empty()) return camera.times_ns[frame];
  return std::llround(static_cast<double>(frame) * static_cast<double>(kNanosecondsPerSecond) /
                      manifest_.nominal_fps);
}

void Importer::import_file(const schemas::ImportManifest::Frame& frame, const Target& target) {
  const std::filesystem::path file = base_ / frame.file;
  const std::string text = read_file(file);
  const auto bytes = std::as_bytes(std::span(text));
  if (target.encoding) {
    if (is_jpeg(bytes)) {
      throw Error::bad_input(
          fmt::format("the image is JPEG, but the first one of camera \"{}\" has "
                      "more than 8 bits",
                      target.geometry.id),
          file.string(), "Give all images of a camera one depth, or import with 8 bits");
    }
    append_deep(read_deep_image(reader_, exr_reader_, file, target.size(), *target.encoding),
                frame.time_ns, target, file.string());
  } else if (is_jpeg(bytes)) {
    append_jpeg(bytes, frame.time_ns, target, file.string());
  } else {
    if (options_.keep_depth && deep_encoding_of_image(reader_, exr_reader_, file, linear())) {
      throw Error::bad_input(fmt::format("the image has more than 8 bits, but the first one of "
                                         "camera \"{}\" has not",
                                         target.geometry.id),
                             file.string(),
                             "Give all images of a camera one depth, or import with 8 bits");
    }
    append_image(read_source_image(reader_, file, target.size(), linear()), frame.time_ns, target);
  }
}

void Importer::import_movie(const schemas::ImportManifest::Camera& camera, const Target& target) {
  const std::filesystem::path file = base_ / camera.movie;
  const std::size_t times = camera.times_ns.size();
  const auto refuse_count = [&](std::size_t frames) {
    throw Error::bad_input(
        fmt::format("the movie has {} frames, but the camera \"{}\" has {} times", frames,
                    camera.geometry.id, times),
        file.string(), "Set one time per frame in \"times_ns\"");
  };
  MovieReader movie(file);
  MovieFrame frame;
  std::size_t count = 0;
  for (; movie.next(frame, target.encoding.has_value()); ++count) {
    stop_if_asked(target);
    if (times > 0 && count == times)
      refuse_count(count + 1 + static_cast<std::size_t>(movie.skip_rest()));
    const std::string name = fmt::format("{} frame {}", file.string(), count);
    if (!frame.jpeg.empty()) {
      append_jpeg(frame.jpeg, time_of(camera, count), target, name);
    } else {
      if (linear() && !target.encoding) {
        throw Error::bad_input("color_space is \"lin_rec709_scene\", but a movie is not linear",
                               file.string(), "Set color_space to \"srgb_texture\"");
      }
      if (target.encoding) {
        check_image_size({frame.deep.width, frame.deep.height}, target.size(), name);
        append_deep(deep_source_of_movie(frame.deep, *target.encoding), time_of(camera, count),
                    target, name);
        continue;
      }
      check_image_size({frame.image.width, frame.image.height}, target.size(), name);
      append_image(frame.image, time_of(camera, count), target);
    }
  }
  if (times > 0 && count != times) refuse_count(count);
  if (count == 0) {
    throw Error::bad_input("the movie has no frame", file.string(), "Choose a file with video");
  }
}

void Importer::append_jpeg(std::span<const std::byte> jpeg, Nanoseconds time, const Target& target,
                           const std::string& name) {
  if (linear()) {
    throw Error::bad_input("color_space is \"lin_rec709_scene\", but a JPEG is not linear", name,
                           "Set color_space to \"srgb_texture\"");
  }
  const store::JpegLayout layout = store::parse_jpeg_layout(jpeg, name);
  check_image_size({layout.width, layout.height}, target.size(), name);
  if (options_.restart_markers) {
    append(store::add_restart_markers(jpeg, *options_.restart_markers, name), time, target);
    ++rewritten_;
  } else {
    append(jpeg, time, target);
    ++copied_;
  }
}

void Importer::append_image(const store::RgbImage& image, Nanoseconds time, const Target& target) {
  append(store::encode_jpeg(image, options_.encode), time, target);
  ++encoded_;
}

void Importer::append_deep(const DeepSource& source, Nanoseconds time, const Target& target,
                           const std::string& name) {
  append(codec_.encode(source.picture, *target.encoding, {.distance = options_.distance}, name),
         time, target);
  target.peak = std::max(target.peak, source.peak);
  not_finite_ += source.not_finite;
  ++deep_;
}

void Importer::append(std::span<const std::byte> jpeg, Nanoseconds time, const Target& target) {
  target.archive.append(jpeg, time);
  jpeg_bytes_ += jpeg.size();
  const std::int64_t done = ++done_;
  if (all_counted_) report_progress(done, total_);
}

void Importer::report_progress(std::int64_t done, std::int64_t total) const {
  if (!options_.progress) return;
  options_.progress(static_cast<double>(done) / static_cast<double>(total));
}

void Importer::stop_if_asked(const Target& target) const {
  // If another camera failed, no take will be written.
  if (stop_.stop_requested() || target.loop.failed()) {
    throw Error::failed("the import was stopped", "", "Start it again: no take was written");
  }
}

ImportSummary Importer::summary() const {
  return {.cameras = static_cast<int>(manifest_.cameras.size()),
          .frames = done_,
          .copied = copied_,
          .rewritten = rewritten_,
          .encoded = encoded_,
          .deep = deep_,
          .not_finite = not_finite_,
          .jpeg_bytes = jpeg_bytes_};
}

schemas::TakeDocument take_document(
    const schemas::ImportManifest& manifest, const ImportOptions& options,
    const std::vector<std::optional<schemas::PixelEncoding>>& encodings) {
  schemas::TakeDocument take;
  take.name = manifest.name;
  take.created_by = options.created_by;
  take.epoch_utc = manifest.epoch_utc;
  take.nominal_fps = manifest.nominal_fps;
  take.color_space = "srgb_texture";  // linear images are encoded with its curve
  take.clock = "manifest";
  take.arbitrary_scale = manifest.arbitrary_scale;
  take.depth_range = manifest.depth_range;
  for (const auto& camera : manifest.cameras) {
    take.cameras.push_back({.id = camera.geometry.id,
                            .archive = {},
                            .journal = {},
                            .node = {},
                            .pixels = encodings[take.cameras.size()]});
  }
  return take;
}

}  // namespace

schemas::RigDocument rig_of(const schemas::ImportManifest& manifest) {
  schemas::RigDocument rig;
  rig.name = manifest.name;
  for (const auto& camera : manifest.cameras) rig.cameras.push_back({camera.geometry, {}});
  return rig;
}

bool ImportOptions::is_valid(std::string* reason) const {
  return encode.is_valid(reason) &&
         is_within("distance of pictures", distance, 0.0, 15.0, reason) &&
         is_within("restart interval (MCUs)", restart_markers.value_or(0), -1, 65535, reason);
}

ImportSummary import_take(const schemas::ImportManifest& manifest,
                          const std::filesystem::path& base,
                          const std::filesystem::path& take_folder, const ImportOptions& options,
                          std::stop_token stop) {
  require_valid(options, "import");
  Importer importer(manifest, base, options, std::move(stop));
  importer.check_files();
  require_open_files(manifest.cameras.size());
  const auto encodings = importer.encodings();
  store::TakeWriter writer(take_folder, take_document(manifest, options, encodings),
                           rig_of(manifest));
  const auto import_camera = [&](std::size_t index, const ParallelLoop& loop) {
    const auto camera = static_cast<int>(index);
    const double peak = importer.import_camera(manifest.cameras[index], encodings[index],
                                               writer.archive(camera), loop);
    constexpr double kLeastPeak = 1e-3;  // of black pictures
    if (encodings[index]) writer.set_peak(camera, std::max(peak, kLeastPeak));
  };
  raystage::parallel_for(std::size_t{0}, manifest.cameras.size(), import_camera);
  writer.commit();
  return importer.summary();
}

}  // namespace raystage::ingest
