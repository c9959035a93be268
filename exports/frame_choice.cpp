// SPDX-License-Identifier: Apache-2.0
// Chooses frames. With constant times, the frame of output time t is that of the timeline's tick
// nearest to t: the tick assigns each camera's frame by its corrected time (store/timeline.h).
// Cost: linear in the number of records.
#include "exports/frame_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/error.h"
#include "base/frame_rate.h"
#include "base/options.h"
#include "store/lost_frames.h"

namespace raystage::exports {
namespace {

constexpr double kMaxFps = 1000;
constexpr std::size_t kMaxFrames = 100'000'000;  // of all cameras: 3 GB of records

/// The range of times, ns since the take's epoch, inclusive.
struct Range {
  double begin = -std::numeric_limits<double>::infinity();
  double end = std::numeric_limits<double>::infinity();
  bool contains(Nanoseconds time) const {
    const auto t = static_cast<double>(time);
    return t >= begin && t <= end;
  }
};

std::vector<int> chosen_cameras(const store::Take& take, const FrameChoiceOptions& options) {
  std::vector<int> cameras;
  if (options.cameras.empty()) {
    cameras.resize(static_cast<std::size_t>(take.camera_count()));
    std::iota(cameras.begin(), cameras.end(), 0);
    return cameras;
  }
  for (const std::string& id : options.cameras) {
    const int camera = take.camera_index(id);
    if (camera < 0) {
      throw Error::bad_input(fmt::format("the take has no camera \"{}\"", id),
                             take.folder().string(), "`raystage info TAKE` lists its cameras")
          .concerning({"cameras"});
    }
    if (std::ranges::find(cameras, camera) != cameras.end()) {
      throw Error::bad_input(fmt::format("the camera \"{}\" is given twice", id),
                             take.folder().string(), "Name each camera once")
          .concerning({"cameras"});
    }
    cameras.push_back(camera);
  }
  return cameras;
}

CameraFrames recorded_frames(const store::Take& take, int camera, const FrameChoiceOptions& options,
                             const std::optional<store::Timeline>& timeline, const Range& range) {
  CameraFrames result;
  result.camera = camera;
  const auto corrected = [&](Nanoseconds stamp) {
    const bool has_clock = timeline && static_cast<std::size_t>(camera) < timeline->clocks.size();
    return has_clock ? timeline->clocks[camera].corrected(stamp) : stamp;
  };
  const auto is_wanted = [&](Nanoseconds stamp) {
    const Nanoseconds shown = options.times == FrameTimes::kSynchronised ? corrected(stamp) : stamp;
    if (!range.contains(shown)) return false;
    if (!options.frames) return true;
    const auto tick = store::nearest_tick(timeline->ticks, corrected(stamp));
    return tick && std::ranges::binary_search(*options.frames, static_cast<int>(*tick) + 1);
  };
  const store::ArchiveReader& archive = take.archive(camera);
  const auto frames = archive.frames();
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const Nanoseconds stamp = frames[i].time_ns;
    if (!is_wanted(stamp)) continue;
    ChosenFrame frame;
    frame.number = static_cast<int>(i) + 1;
    frame.source = static_cast<int>(i);
    frame.source_ns = stamp;
    frame.time_ns = options.times == FrameTimes::kSynchronised ? corrected(stamp) : stamp;
    // A clock that went back may put a corrected time before the previous one.
    if (!result.frames.empty() && frame.time_ns <= result.frames.back().time_ns) {
      frame.time_ns = result.frames.back().time_ns + 1;
    }
    result.frames.push_back(frame);
  }
  result.absent = static_cast<int>(
      std::ranges::count_if(archive.records(), [&](const store::FrameRecord& record) {
        return record.status != store::FrameStatus::kStored && is_wanted(record.time_ns);
      }));
  return result;
}

/// Replaces absent frames (source -1, is_held) as the options say.
void fill_absent(CameraFrames& camera, AbsentFrames policy) {
  auto& frames = camera.frames;
  if (policy == AbsentFrames::kGap) {
    std::erase_if(frames, [](const ChosenFrame& frame) { return frame.source < 0; });
    return;
  }
  if (policy != AbsentFrames::kHold) return;
  const auto first =
      std::ranges::find_if(frames, [](const ChosenFrame& frame) { return frame.source >= 0; });
  if (first == frames.end()) return;  // black: the camera has no frame at all
  ChosenFrame held = *first;
  for (ChosenFrame& frame : frames) {
    if (frame.source >= 0) {
      held = frame;
    } else {
      frame.source = held.source;
      frame.source_ns = held.source_ns;
    }
  }
}

/// Returns the ticks of the output's frames.
std::vector<std::size_t> shown_ticks(const store::Timeline& timeline,
                                     const FrameChoiceOptions& options, const Range& range,
                                     double fps) {
  std::vector<std::size_t> ticks;
  for (std::size_t i = 0; i < timeline.ticks.size(); ++i) {
    if (!range.contains(timeline.ticks[i].time_ns)) continue;
    if (options.frames && !std::ranges::binary_search(*options.frames, static_cast<int>(i) + 1)) {
      continue;
    }
    ticks.push_back(i);
  }
  if (options.fps <= 0 || ticks.empty()) return ticks;
  const Nanoseconds begin = timeline.ticks[ticks.front()].time_ns;
  const Nanoseconds end = timeline.ticks[ticks.back()].time_ns;
  const double seconds = static_cast<double>(end - begin) / kNsPerS;
  const double tick_seconds = timeline.fps > 0 ? 1 / timeline.fps : 0;
  const double count = std::max(1.0, std::round((seconds + tick_seconds) * fps));
  if (count > static_cast<double>(kMaxFrames)) {
    throw Error::bad_input(fmt::format("found {:.3g} frames, allowed: {}", count, kMaxFrames), "",
                           "Export a shorter range")
        .concerning({"fps"});
  }
  std::vector<std::size_t> shown;
  for (int n = 0; n < static_cast<int>(count); ++n) {
    const auto time = begin + static_cast<Nanoseconds>(std::llround(n / fps * kNsPerS));
    const auto after = std::ranges::lower_bound(
        ticks, time, {}, [&](std::size_t tick) { return timeline.ticks[tick].time_ns; });
    std::size_t best = after == ticks.end() ? ticks.back() : *after;
    if (after != ticks.begin() && after != ticks.end()) {
      const std::size_t before = *(after - 1);
      if (time - timeline.ticks[before].time_ns <= timeline.ticks[best].time_ns - time) {
        best = before;
      }
    }
    shown.push_back(best);
  }
  return shown;
}

Error absent_frame_error(const store::Take& take, int camera, std::size_t tick) {
  return Error::bad_input(fmt::format("camera \"{}\" has no frame at frame {} (tick {})",
                                      take.document().cameras[camera].id, tick + 1, tick),
                          take.folder().string(),
                          "Choose other frames or cameras, or what stands for an absent frame")
      .concerning({"absent"});
}

CameraFrames constant_frames(const store::Take& take, int camera, const FrameChoiceOptions& options,
                             const store::Timeline& timeline, const std::vector<std::size_t>& ticks,
                             double fps) {
  CameraFrames result;
  result.camera = camera;
  for (std::size_t n = 0; n < ticks.size(); ++n) {
    const std::size_t tick = ticks[n];
    ChosenFrame frame;
    frame.number = options.fps > 0 ? static_cast<int>(n) + 1 : static_cast<int>(tick) + 1;
    frame.time_ns = static_cast<Nanoseconds>(
        std::llround(static_cast<long double>(n) * kNanosecondsPerSecond / fps));
    frame.source = timeline.ticks[tick].frame[camera];
    if (frame.source >= 0) {
      frame.source_ns = take.archive(camera).frames()[frame.source].time_ns;
    } else {
      if (options.absent == AbsentFrames::kError) throw absent_frame_error(take, camera, tick);
      frame.is_held = true;
      ++result.absent;
    }
    result.frames.push_back(frame);
  }
  fill_absent(result, options.absent);
  return result;
}

/// Returns the rate of one frame per tick: the nominal rate if the measured one is within 0.1 % of
/// it, as films are conformed, or else the measured one. As an exact ratio, if it is one.
double constant_rate(double fps, double nominal_fps) {
  constexpr double kConformed = 1e-3;
  if (nominal_fps > 0 && std::abs(fps / nominal_fps - 1) < kConformed) fps = nominal_fps;
  const auto rate = frame_rate_from(std::round(fps * 1e6) / 1e6);
  return rate ? rate->fps() : fps;
}

}  // namespace

bool FrameChoiceOptions::is_valid(std::string* reason) const {
  if (from_s && to_s && *from_s > *to_s) {
    *reason = fmt::format("the range of times {} to {} s is empty", *from_s, *to_s);
    return false;
  }
  return is_within("fps", fps, 0, kMaxFps, reason);
}

std::size_t FrameChoice::frames() const {
  std::size_t count = 0;
  for (const CameraFrames& camera : cameras) count += camera.frames.size();
  return count;
}

FrameChoice choose_frames(const store::Take& take, const FrameChoiceOptions& options) {
  require_valid(options, take.folder().string());
  Range range;
  if (options.from_s) range.begin = *options.from_s * kNsPerS;
  if (options.to_s) range.end = *options.to_s * kNsPerS;
  const bool needs_timeline = options.times != FrameTimes::kRecorded || options.frames;
  std::optional<store::Timeline> timeline;
  if (needs_timeline) {
    timeline = store::read_timeline(take);
  } else {
    timeline = store::read_timeline_if_present(take);
  }
  FrameChoice choice;
  choice.fps = timeline ? timeline->fps : take.document().nominal_fps;
  if (options.times == FrameTimes::kConstant) {
    choice.fps = options.fps > 0 ? constant_rate(options.fps, options.fps)
                                 : constant_rate(timeline->fps, take.document().nominal_fps);
    if (!(choice.fps > 0)) {
      throw Error::bad_input("the take has no frame rate", take.folder().string(),
                             "Give the frames per second")
          .concerning({"fps"});
    }
  }
  const std::vector<int> cameras = chosen_cameras(take, options);
  std::vector<std::size_t> ticks;
  if (options.times == FrameTimes::kConstant) {
    ticks = shown_ticks(*timeline, options, range, choice.fps);
    if (ticks.size() > kMaxFrames / cameras.size()) {
      throw Error::bad_input("there are more than 100 million frames", take.folder().string(),
                             "Export fewer cameras or a shorter range");
    }
  }
  for (const int camera : cameras) {
    choice.cameras.push_back(
        options.times == FrameTimes::kConstant
            ? constant_frames(take, camera, options, *timeline, ticks, choice.fps)
            : recorded_frames(take, camera, options, timeline, range));
  }
  if (choice.frames() == 0) {
    throw Error::bad_input("no frame of these cameras is in the range", take.folder().string(),
                           "`raystage info TAKE` shows cameras, frames and duration")
        .concerning({"frames", "from", "to"});
  }
  if (options.times == FrameTimes::kConstant) {
    if (!ticks.empty()) choice.origin_ns = timeline->ticks[ticks.front()].time_ns;
  } else if (options.starts_at_zero) {
    choice.origin_ns = std::numeric_limits<Nanoseconds>::max();
    for (const CameraFrames& camera : choice.cameras) {
      if (camera.frames.empty()) continue;
      choice.origin_ns = std::min(choice.origin_ns, camera.frames.front().time_ns);
    }
    for (CameraFrames& camera : choice.cameras) {
      for (ChosenFrame& frame : camera.frames) frame.time_ns -= choice.origin_ns;
    }
  }
  for (const CameraFrames& camera : choice.cameras) {
    const store::ArchiveReader& archive = take.archive(camera.camera);
    const auto frames = archive.frames();
    for (const ChosenFrame& frame : camera.frames) {
      if (frame.source < 0 || store::is_lost(archive, frames[frame.source])) continue;
      choice.source_bytes += frames[frame.source].size;
    }
  }
  return choice;
}

}  // namespace raystage::exports
