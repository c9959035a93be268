// SPDX-License-Identifier: Apache-2.0
// Detects the corners of a board (board.h) in the frames of a take. For a lens it searches a few
// frames of one camera, spread evenly. For an array it searches all frames of all cameras, which
// gives one track per corner and camera. Cost: one full JPEG decode and one board search per frame;
// frames run in parallel.
#include "calibrate/detect/board_detection.h"

#include <algorithm>
#include <atomic>

#include "base/error.h"
#include "base/parallel.h"
#include "store/jpeg/decode.h"
#include "store/timeline.h"

namespace raystage::calibrate {
namespace {

void check_stop(const std::stop_token& stop, const store::Take& take) {
  if (!stop.stop_requested()) return;
  throw Error::failed("the detection of the board was stopped", take.folder().string(),
                      "Start it again");
}

std::vector<BoardCornerDetection> corners_in(const store::Take& take, int camera, int frame,
                                             const BoardDetector& finder) {
  const auto jpeg = take.archive(camera).intact_jpeg(frame);
  if (!jpeg) return {};  // its camera counts as absent
  store::JpegDecoder decoder;
  return finder.find(decoder.decode(*jpeg, take.document().cameras[camera].id));
}

/// Returns at most `most` of `count` indices, evenly spread.
std::vector<int> spread(int count, int most) {
  std::vector<int> chosen;
  const int kept = std::min(count, most);
  for (int k = 0; k < kept; ++k) {
    chosen.push_back(static_cast<int>((2LL * k + 1) * count / (2LL * kept)));
  }
  return chosen;
}

}  // namespace

std::vector<BoardView> detect_board_views(const store::Take& take, int camera,
                                          const BoardDetector& finder, int most,
                                          const std::function<void(double)>& progress,
                                          const std::stop_token& stop) {
  const auto count = static_cast<int>(take.archive(camera).frames().size());
  const std::vector<int> frames = spread(count, most);
  std::vector<BoardView> views(frames.size());
  std::atomic<std::size_t> done = 0;
  parallel_for(std::size_t{0}, frames.size(), [&](std::size_t i) {
    check_stop(stop, take);
    views[i].frame = frames[i];
    for (const BoardCornerDetection& corner : corners_in(take, camera, frames[i], finder)) {
      views[i].object_points.push_back(finder.board().corner(corner.index));
      views[i].pixels.push_back(corner.pixel);
    }
    progress(static_cast<double>(++done) / frames.size());
  });
  std::erase_if(views, [](const BoardView& view) { return view.pixels.empty(); });
  return views;
}

PointTracks track_board_corners(const store::Take& take,
                                const std::vector<std::vector<Nanoseconds>>& times,
                                const BoardDetector& finder,
                                const std::function<void(double)>& progress,
                                const std::stop_token& stop) {
  const auto corners = static_cast<std::size_t>(finder.board().corners());
  std::vector<std::pair<std::size_t, std::size_t>> frames;  // camera, frame
  PointTracks tracks(times.size(), std::vector<PointTrack>(corners));
  for (std::size_t c = 0; c < times.size(); ++c) {
    std::vector<std::pair<Nanoseconds, std::size_t>> in_order;
    for (std::size_t i = 0; i < times[c].size(); ++i) {
      if (times[c][i] != store::kExcludedTime) in_order.emplace_back(times[c][i], i);
    }
    std::ranges::stable_sort(in_order);
    for (const auto& [time, frame] : in_order) {
      frames.emplace_back(c, frame);
      for (PointTrack& track : tracks[c]) track.frame_detections.push_back({time, {}});
    }
  }
  std::vector<std::size_t> observation_index(frames.size(), 0);
  for (std::size_t k = 1; k < frames.size(); ++k) {
    observation_index[k] =
        frames[k].first == frames[k - 1].first ? observation_index[k - 1] + 1 : 0;
  }
  std::atomic<std::size_t> done = 0;
  parallel_for(std::size_t{0}, frames.size(), [&](std::size_t k) {
    check_stop(stop, take);
    const auto [camera, frame] = frames[k];
    for (const BoardCornerDetection& corner :
         corners_in(take, static_cast<int>(camera), static_cast<int>(frame), finder)) {
      LightSpot& spot = tracks[camera][corner.index].frame_detections[observation_index[k]].spot;
      spot.result = LightDetectionStatus::kFound;
      spot.centre = corner.pixel;
    }
    progress(static_cast<double>(++done) / frames.size());
  });
  return tracks;
}

}  // namespace raystage::calibrate
