// SPDX-License-Identifier: Apache-2.0
#include "exports/export_movies.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <vector>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "base/error.h"
#include "base/frame_rate.h"
#include "base/parallel.h"
#include "exports/exported_rig.h"
#include "exports/output_folder.h"
#include "exports/source_frames.h"
#include "schemas/rig_document.h"

namespace raystage::exports {
namespace {

std::optional<FrameRate> rate_of(const FrameChoice& choice, FrameTimes times) {
  if (times != FrameTimes::kConstant) return std::nullopt;
  const auto rate = frame_rate_from(std::round(choice.fps * 1e6) / 1e6);
  if (rate) return rate;
  throw Error::bad_input(fmt::format("movies cannot have {} frames per second", choice.fps), "",
                         "Give a rate up to 1000 with at most six decimals")
      .concerning({"fps"});
}

double pixels_of(const store::Take& take, const FrameChoice& choice) {
  double pixels = 0;
  for (const CameraFrames& camera : choice.cameras) {
    const rig::CameraModel& model = take.rig().cameras[camera.camera].model;
    pixels += static_cast<double>(model.width()) * model.height() *
              static_cast<double>(camera.frames.size());
  }
  return pixels;
}

MovieDescription movie_description(const store::Take& take, const CameraFrames& camera,
                                   const FrameChoice& choice, FrameTimes times) {
  const rig::Rig::Camera& of_rig = take.rig().cameras[camera.camera];
  MovieDescription description;
  description.name = of_rig.id;
  description.width = of_rig.model.width();
  description.height = of_rig.model.height();
  description.epoch_utc = take.document().epoch_utc + choice.origin_ns;
  description.rate = rate_of(choice, times);
  if (choice.fps > 0) {
    description.typical_duration = static_cast<Nanoseconds>(kNsPerS / choice.fps);
  }
  return description;
}

}  // namespace

ExportReport export_movies(const store::Take& take, const MovieExportOptions& options,
                           const std::stop_token& stop) {
  const MovieCodec& codec = *options.codec;
  const std::string extension =
      options.extension.empty() ? codec.extensions().front() : options.extension;
  movie_extension(codec, "CAMERA" + extension);
  if (!codec.has_exact_times() && options.frames.times != FrameTimes::kConstant) {
    throw Error::bad_input(fmt::format("{} movies have constant times only", codec.name()), "",
                           "Choose constant times or another codec")
        .concerning({"times"});
  }
  check_output_outside(options.output, take);
  const FrameChoice choice = choose_frames(take, options.frames);
  OutputFolder folder(options.output);
  check_free_space(options.output, codec.estimated_bytes(static_cast<double>(choice.source_bytes),
                                                         pixels_of(take, choice)));
  const CancellationScope scope(stop);
  const std::size_t cameras = choice.cameras.size();
  std::vector<ExportReport::Camera> counts(cameras);
  std::vector<std::vector<FrameRow>> rows(cameras);
  FrameCounter counter(choice.frames(), options.progress);
  folder.fill([&] {
    parallel_for(std::size_t{0}, cameras, [&](std::size_t i, const ParallelLoop& loop) {
      const CameraFrames& camera = choice.cameras[i];
      SourceFrames source(take, camera, options.frames.absent);
      const std::string file = take.document().cameras[camera.camera].id + extension;
      std::unique_ptr<MovieFile> movie;
      while (const auto ready = source.next()) {
        if (loop.failed()) return;
        if (!movie) {
          movie = codec.create(folder.working() / file,
                               movie_description(take, camera, choice, options.frames.times));
        }
        movie->append(ready->jpeg, codec.copies_jpeg() ? nullptr : &source.picture(),
                      ready->frame.time_ns);
        rows[i].push_back({source.counts().id, file, ready->frame});
        counter.add();
      }
      if (movie) movie->close();
      counts[i] = source.counts();
    });
  });
  ExportReport report;
  report.cameras = std::move(counts);
  report.fps = choice.fps;
  report.origin_ns = choice.origin_ns;
  std::vector<FrameRow> all;
  for (auto& of_camera : rows) all.insert(all.end(), of_camera.begin(), of_camera.end());
  write_file_atomically(folder.working() / "frames.csv",
                        format_frame_rows(all, take.document().epoch_utc));
  schemas::write_rig(exported_rig(take, choice), folder.working() / "rig.json");
  for (const ExportReport::Camera& camera : report.cameras) {
    if (camera.frames == 0) report.notes.push_back("camera " + camera.id + " has no frames");
  }
  folder.commit();
  report.status = RunStatus::kFinished;
  return report;
}

}  // namespace raystage::exports
