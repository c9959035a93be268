// SPDX-License-Identifier: Apache-2.0
// Tracks a point light through a take (thesis 4.3): decodes every frame, subtracts the background
// and detects the light (light_spot.h). The background is the median of 15 frames spread over the
// recording. Times come from the take's timeline or, without one, from a resynchronisation. The
// result has one detection per camera and frame. Cost: one full JPEG decode and one detection per
// frame; cameras run in parallel.
#include "calibrate/detect/point_tracks.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <optional>

#include "base/error.h"
#include "base/options.h"
#include "base/parallel.h"
#include "calibrate/geometry/calibration_verdict.h"
#include "calibrate/geometry/median.h"
#include "store/jpeg/decode.h"
#include "store/linear_from_frame_code.h"
#include "store/processing/sync/resync.h"
#include "store/timeline.h"

namespace raystage::calibrate {
namespace {

/// Decodes a few pictures, spread over the recording; rotten ones are left out. Returns nullopt
/// without any.
std::optional<LightBackground> background_of(const store::Take& take,
                                             const store::ArchiveReader& archive,
                                             store::JpegDecoder& decoder) {
  constexpr std::size_t kPictures = 15;
  const std::size_t frames = archive.frames().size();
  const std::size_t count = std::min(frames, kPictures);
  std::vector<store::RgbImage> pictures;
  for (std::size_t k = 0; k < count; ++k) {
    const auto frame = static_cast<int>((2 * k + 1) * frames / (2 * count));
    const auto jpeg = archive.intact_jpeg(frame);
    if (jpeg) pictures.push_back(decoder.decode(*jpeg, "frame"));
  }
  if (pictures.empty()) return std::nullopt;
  std::array<float, 256> linear_from_code{};
  for (std::size_t code = 0; code < linear_from_code.size(); ++code) {
    linear_from_code[code] = static_cast<float>(
        store::linear_from_frame_code(take.document(), static_cast<double>(code)));
  }
  return LightBackground(pictures, linear_from_code);
}

void mark_unsteady(PointTrack& track) {
  std::vector<double> light;
  for (const PointTrack::FrameDetection& detection : track.frame_detections) {
    if (detection.spot.result == LightDetectionStatus::kFound)
      light.push_back(detection.spot.light);
  }
  if (light.empty()) return;
  constexpr double kSteady = 0.1;  // of the median: a light three times as far appears as dim
  const double least = kSteady * median(std::move(light));
  for (PointTrack::FrameDetection& detection : track.frame_detections) {
    if (detection.spot.result == LightDetectionStatus::kFound && detection.spot.light < least) {
      detection.spot.result = LightDetectionStatus::kUnsteady;
    }
  }
}

PointTrack track_of(const store::Take& take, int camera, const std::vector<Nanoseconds>& times,
                    const LightDetectionOptions& options, const std::function<void()>& frame_done,
                    const std::stop_token& stop) {
  const store::ArchiveReader& archive = take.archive(camera);
  PointTrack track;
  if (archive.frames().empty()) return track;
  store::JpegDecoder decoder;
  const std::optional<LightBackground> background = background_of(take, archive, decoder);
  if (!background) return track;
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (stop.stop_requested()) {
      throw Error::failed("the detection of the light was stopped", take.folder().string(),
                          "Start it again");
    }
    frame_done();
    if (times[i] == store::kExcludedTime) continue;
    const auto jpeg = archive.intact_jpeg(static_cast<int>(i));
    if (!jpeg) continue;  // the camera counts as absent
    const store::RgbImage picture = decoder.decode(*jpeg, take.document().cameras[camera].id);
    track.frame_detections.push_back({times[i], detect_light(picture, *background, options)});
  }
  std::ranges::stable_sort(track.frame_detections, {}, &PointTrack::FrameDetection::time);
  mark_unsteady(track);
  for (const PointTrack::FrameDetection& detection : track.frame_detections) {
    ++track.frame_counts[static_cast<std::size_t>(detection.spot.result)];
  }
  return track;
}

}  // namespace

std::vector<std::vector<Nanoseconds>> synchronised_frame_times(const store::Take& take) {
  const std::optional<store::Timeline> timeline = store::read_timeline_if_present(take);
  if (!timeline) {
    store::ResyncOptions options;
    options.nominal_fps = take.document().nominal_fps;
    options.trust_timestamps = !store::has_arrival_timestamps(take.document());
    return store::resynchronise(store::camera_timestamps(take), options, take.folder().string())
        .times;
  }
  std::vector<std::vector<Nanoseconds>> times(static_cast<std::size_t>(take.camera_count()));
  for (std::size_t c = 0; c < times.size(); ++c) {
    times[c].assign(take.archive(static_cast<int>(c)).frames().size(), store::kExcludedTime);
    for (const store::FrameSelection& tick : timeline->ticks) {
      if (tick.frame[c] < 0) continue;
      times[c][tick.frame[c]] = tick.time_ns + tick.difference[c];
    }
  }
  return times;
}

PointTracks track_light(const store::Take& take, const std::vector<std::vector<Nanoseconds>>& times,
                        const LightDetectionOptions& options,
                        const std::function<void(double)>& progress, const std::stop_token& stop) {
  require_valid(options, "detection of the light");
  PointTracks tracks(times.size());
  std::size_t all = 0;
  for (const auto& of_camera : times) all += of_camera.size();
  std::atomic<std::size_t> done = 0;
  const auto frame_done = [&] {
    const std::size_t now = ++done;
    if (now % 16 == 0 || now == all) progress(static_cast<double>(now) / all);
  };
  parallel_for(std::size_t{0}, times.size(), [&](std::size_t c) {
    tracks[c].push_back(track_of(take, static_cast<int>(c), times[c], options, frame_done, stop));
  });
  return tracks;
}

std::string format_track_summary(const PointTracks& tracks,
                                 const std::vector<schemas::DetectionsDocument::Camera>& cameras) {
  std::array<int, kLightDetectionStatusCount> sum{};
  int all = 0;
  std::vector<std::string> few;
  for (std::size_t c = 0; c < tracks.size(); ++c) {
    for (std::size_t k = 0; k < kLightDetectionStatusCount; ++k)
      sum[k] += tracks[c].front().frame_counts[k];
    const auto frames = static_cast<int>(tracks[c].front().frame_detections.size());
    all += frames;
    if (tracks[c].front().frame_counts[0] < frames / 4) {
      few.push_back(
          fmt::format("{} ({} of {})", cameras[c].id, tracks[c].front().frame_counts[0], frames));
    }
  }
  std::string text = fmt::format("Light      in {} of {} frames", sum[0], all);
  for (std::size_t k = 1; k < kLightDetectionStatusCount; ++k) {
    if (sum[k] == 0) continue;
    text += fmt::format("{} {} {}", text.find(';') == std::string::npos ? ";" : ",", sum[k],
                        name_of(static_cast<LightDetectionStatus>(k)));
  }
  text += "\n";
  if (!few.empty()) text += "Light      few detections in " + abbreviate_list(few) + "\n";
  return text;
}

std::vector<schemas::DetectionsDocument::Camera> detection_cameras(const store::Take& take) {
  std::vector<schemas::DetectionsDocument::Camera> cameras;
  for (const rig::Rig::Camera& camera : take.rig().cameras) {
    cameras.push_back({camera.id, camera.model.width(), camera.model.height()});
  }
  return cameras;
}

Nanoseconds median_frame_period(const std::vector<std::vector<Nanoseconds>>& times) {
  std::vector<Nanoseconds> intervals;
  for (const auto& of_camera : times) {
    Nanoseconds before = store::kExcludedTime;
    for (const Nanoseconds time : of_camera) {
      if (time != store::kExcludedTime && before != store::kExcludedTime && time > before)
        intervals.push_back(time - before);
      before = time;
    }
  }
  return intervals.empty() ? 0 : median(std::move(intervals));
}

}  // namespace raystage::calibrate
