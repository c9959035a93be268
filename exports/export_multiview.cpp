// SPDX-License-Identifier: Apache-2.0
// Merges the frames of all cameras by time; at equal times in the order of the tracks. Holds one
// frame per camera in memory.
#include "exports/export_multiview.h"

#include <algorithm>
#include <memory>
#include <queue>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "base/error.h"
#include "exports/matroska_movie.h"
#include "exports/source_frames.h"

namespace raystage::exports {
namespace {

MatroskaDescription tracks_of(const store::Take& take, const FrameChoice& choice,
                              FrameTimes times) {
  MatroskaDescription description;
  description.title = take.document().name;
  description.epoch_utc = take.document().epoch_utc + choice.origin_ns;
  for (const CameraFrames& camera : choice.cameras) {
    const rig::Rig::Camera& of_rig = take.rig().cameras[camera.camera];
    MatroskaTrack track{of_rig.id, of_rig.model.width(), of_rig.model.height()};
    if (times == FrameTimes::kConstant) {
      track.default_duration = static_cast<Nanoseconds>(kNsPerS / choice.fps);
    }
    description.tracks.push_back(std::move(track));
  }
  for (const char* name : {"rig.json", "take.json"}) {
    description.attachments.push_back({name, "application/json", read_file(take.file(name))});
  }
  return description;
}

}  // namespace

ExportReport export_multiview(const store::Take& take, const MultiviewExportOptions& options,
                              const std::stop_token& stop) {
  if (options.output.extension() != ".mkv") {
    throw Error::bad_input("a movie with a track per camera is a Matroska file",
                           options.output.string(), "Use the extension .mkv");
  }
  check_output_file(options.output, options.existing, take);
  const FrameChoice choice = choose_frames(take, options.frames);
  check_free_space(options.output, static_cast<double>(choice.source_bytes));
  const CancellationScope scope(stop);
  MatroskaMovie movie(options.output, tracks_of(take, choice, options.frames.times));
  FrameCounter counter(choice.frames(), options.progress);

  std::vector<std::unique_ptr<SourceFrames>> sources;
  std::vector<std::optional<SourceFrames::Ready>> next;
  for (const CameraFrames& camera : choice.cameras) {
    sources.push_back(std::make_unique<SourceFrames>(take, camera, options.frames.absent));
    next.push_back(sources.back()->next());
  }
  using Entry = std::pair<Nanoseconds, int>;  // time and track, the earliest first
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> order;
  const auto enqueue = [&](int track) {
    if (next[track]) order.emplace(next[track]->frame.time_ns, track);
  };
  for (int track = 0; track < static_cast<int>(next.size()); ++track) enqueue(track);
  while (!order.empty()) {
    throw_if_cancelled();
    const auto [time, track] = order.top();
    order.pop();
    movie.append(track, time, next[track]->jpeg);
    next[track] = sources[track]->next();
    enqueue(track);
    counter.add();
  }
  movie.close();
  ExportReport report;
  for (const auto& source : sources) {
    report.cameras.push_back(source->counts());
    if (source->counts().frames == 0) {
      report.notes.push_back("camera " + source->counts().id + " has no frames");
    }
  }
  report.fps = choice.fps;
  report.origin_ns = choice.origin_ns;
  report.status = RunStatus::kFinished;
  return report;
}

}  // namespace raystage::exports
