// SPDX-License-Identifier: Apache-2.0
#include "calibrate/light_tracks.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>

#include "rig/calibration/verdict.h"
#include "schemas/error.h"
#include "schemas/parallel.h"
#include "store/code_light.h"
#include "store/jpeg/decode.h"
#include "store/sync/resync.h"
#include "store/timeline.h"

namespace raystage {
namespace {

/// A few pictures from all over the recording.
LightBackground background_of(const Take& take, const ArchiveReader& archive,
                              JpegDecoder& decoder) {
  constexpr std::size_t kPictures = 15;
  const std::size_t frames = archive.frames().size();
  const std::size_t count = std::min(frames, kPictures);
  std::vector<RgbImage> pictures;
  for (std::size_t k = 0; k < count; ++k) {
    const auto frame = static_cast<int>((2 * k + 1) * frames / (2 * count));
    pictures.push_back(decoder.decode(archive.jpeg(frame), "frame"));
  }
  std::array<float, 256> light_of_code{};
  for (std::size_t code = 0; code < light_of_code.size(); ++code) {
    light_of_code[code] =
        static_cast<float>(linear_of_code(take.document(), static_cast<double>(code)));
  }
  return {pictures, light_of_code};
}

void mark_unsteady(LightTrack& track) {
  std::vector<double> light;
  for (const LightTrack::Sight& sight : track.sights) {
    if (sight.spot.result == LightResult::kFound) light.push_back(sight.spot.light);
  }
  if (light.empty()) return;
  const auto middle = light.begin() + static_cast<std::ptrdiff_t>(light.size() / 2);
  std::ranges::nth_element(light, middle);
  constexpr double kSteady = 0.1;  // of the median: one three times as far is as dim
  for (LightTrack::Sight& sight : track.sights) {
    if (sight.spot.result == LightResult::kFound && sight.spot.light < kSteady * *middle) {
      sight.spot.result = LightResult::kUnsteady;
    }
  }
}

LightTrack track_of(const Take& take, int camera, const std::vector<Nanoseconds>& times,
                    const LightSettings& settings, const std::function<void()>& frame_done,
                    const std::stop_token& stop) {
  const ArchiveReader& archive = take.archive(camera);
  LightTrack track;
  if (archive.frames().empty()) return track;
  JpegDecoder decoder;
  const LightBackground background = background_of(take, archive, decoder);
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (stop.stop_requested()) {
      throw Error::failed("the search for the light was stopped", take.folder().string(),
                          "Start it again");
    }
    frame_done();
    if (times[i] == kNoTime) continue;
    const RgbImage picture =
        decoder.decode(archive.jpeg(static_cast<int>(i)),
                       take.document().cameras[static_cast<std::size_t>(camera)].id);
    track.sights.push_back({times[i], find_light(picture, background, settings)});
  }
  std::ranges::stable_sort(track.sights, {}, &LightTrack::Sight::time);
  mark_unsteady(track);
  for (const LightTrack::Sight& sight : track.sights) {
    ++track.frames_with[static_cast<std::size_t>(sight.spot.result)];
  }
  return track;
}

}  // namespace

std::vector<std::vector<Nanoseconds>> frame_times_of(const Take& take) {
  const std::optional<Timeline> timeline = read_timeline_if_any(take);
  if (!timeline) {
    ResyncSettings settings;
    settings.nominal_fps = take.document().nominal_fps;
    settings.exact_stamps = !marks_arrivals(take.document());
    return resynchronise(stamps_of(take), settings, take.folder().string()).times;
  }
  std::vector<std::vector<Nanoseconds>> times(static_cast<std::size_t>(take.camera_count()));
  for (std::size_t c = 0; c < times.size(); ++c) {
    times[c].assign(take.archive(static_cast<int>(c)).frames().size(), kNoTime);
    for (const FrameSelection& tick : timeline->ticks) {
      if (tick.frame[c] < 0) continue;
      times[c][static_cast<std::size_t>(tick.frame[c])] = tick.time_ns + tick.difference[c];
    }
  }
  return times;
}

Tracks track_light(const Take& take, const std::vector<std::vector<Nanoseconds>>& times,
                   const LightSettings& settings, const std::function<void(double)>& progress,
                   const std::stop_token& stop) {
  Tracks tracks(times.size());
  std::size_t all = 0;
  for (const auto& of_camera : times) all += of_camera.size();
  std::atomic<std::size_t> done = 0;
  const auto frame_done = [&] {
    const std::size_t now = ++done;
    if (now % 16 == 0 || now == all) progress(static_cast<double>(now) / static_cast<double>(all));
  };
  parallel_for(std::size_t{0}, times.size(), [&](std::size_t c) {
    tracks[c].push_back(track_of(take, static_cast<int>(c), times[c], settings, frame_done, stop));
  });
  return tracks;
}

std::string track_text(const Tracks& tracks,
                       const std::vector<DetectionsDocument::Camera>& cameras) {
  std::array<int, kLightResults> sum{};
  int all = 0;
  std::vector<std::string> few;
  for (std::size_t c = 0; c < tracks.size(); ++c) {
    for (std::size_t k = 0; k < kLightResults; ++k) sum[k] += tracks[c].front().frames_with[k];
    const auto frames = static_cast<int>(tracks[c].front().sights.size());
    all += frames;
    if (tracks[c].front().frames_with[0] < frames / 4) {
      few.push_back(
          fmt::format("{} ({} of {})", cameras[c].id, tracks[c].front().frames_with[0], frames));
    }
  }
  std::string text = fmt::format("Light      in {} of {} frames", sum[0], all);
  for (std::size_t k = 1; k < kLightResults; ++k) {
    if (sum[k] == 0) continue;
    text += fmt::format("{} {} {}", text.find(';') == std::string::npos ? ";" : ",", sum[k],
                        name_of(static_cast<LightResult>(k)));
  }
  text += "\n";
  if (!few.empty()) text += "Light      seldom seen by " + few_of(few) + "\n";
  return text;
}

std::vector<DetectionsDocument::Camera> cameras_of(const Take& take) {
  std::vector<DetectionsDocument::Camera> cameras;
  for (const Rig::Camera& camera : take.rig().cameras) {
    cameras.push_back({camera.id, camera.model.width(), camera.model.height()});
  }
  return cameras;
}

Nanoseconds period_of(const std::vector<std::vector<Nanoseconds>>& times) {
  std::vector<Nanoseconds> intervals;
  for (const auto& of_camera : times) {
    Nanoseconds before = kNoTime;
    for (const Nanoseconds time : of_camera) {
      if (time != kNoTime && before != kNoTime && time > before) intervals.push_back(time - before);
      before = time;
    }
  }
  if (intervals.empty()) return 0;
  const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
  std::ranges::nth_element(intervals, middle);
  return *middle;
}

}  // namespace raystage
