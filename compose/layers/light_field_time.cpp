// SPDX-License-Identifier: Apache-2.0
// The instants of a take that a layer shows: of frames and of times within their exposures, the
// nearest ticks or exact times, which have numbers beyond those of the timeline. Cost: the cameras
// of the take for each instant.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "compose/layers/light_field_layer.h"
#include "store/exact_frames.h"

namespace raystage::compose {
namespace {

/// Instants within exposures have numbers from here on, in steps of 1 / kOffsetsPerFrame; shutters
/// open by at most kFramesBefore frames before the first frame.
constexpr int kFirstInExposure = 1 << 30, kFramesBefore = 8;

}  // namespace

double LightFieldLayer::take_seconds(double frame) const {
  if (time_) return time_(frame);
  const double shot_seconds = (frame - first_frame_) * fps_denominator_ / fps_numerator_;
  return layer_.start_seconds + shot_seconds * layer_.speed;
}

Nanoseconds LightFieldLayer::take_time(double frame) const {
  const double seconds = take_seconds(frame);
  constexpr double kLimit = 4e18;  // nanoseconds; keeps the sum below within int64
  return timeline_.ticks.front().time_ns +
         static_cast<Nanoseconds>(std::llround(
             std::clamp(seconds * static_cast<double>(kNanosecondsPerSecond), -kLimit, kLimit)));
}

std::optional<int> LightFieldLayer::tick_at(double frame) const {
  const auto tick = store::nearest_tick(timeline_.ticks, take_time(frame));
  if (!tick || timeline_.ticks[*tick].present() == 0) return std::nullopt;
  return static_cast<int>(*tick);
}

int LightFieldLayer::first_frame_of_time(int frame) const {
  // Times are constant between two equal keys.
  const double seconds = take_seconds(frame);
  int same = frame, other = first_frame_ - 1;
  for (int step = 1; same - step >= first_frame_; step *= 2) {
    if (take_seconds(same - step) != seconds) {
      other = same - step;
      break;
    }
    same -= step;
  }
  while (same - other > 1) {
    const int middle = other + (same - other) / 2;
    (take_seconds(middle) == seconds ? same : other) = middle;
  }
  return same;
}

std::optional<int> LightFieldLayer::exact_tick_at(double frame) const {
  const double whole = std::round(frame);
  const store::FrameSelection exact =
      store::frames_at_time(timeline_, take_.rig(), take_time(frame));
  if (exact.second.empty()) return std::nullopt;
  if (whole >= first_frame_ && take_seconds(frame) == take_seconds(whole)) {
    return static_cast<int>(timeline_.ticks.size()) + first_frame_of_time(static_cast<int>(whole)) -
           first_frame_;
  }
  const double steps = (frame - first_frame_ + kFramesBefore) * kOffsetsPerFrame;
  if (!(steps >= 0 && steps < kFirstInExposure)) return std::nullopt;
  return kFirstInExposure + static_cast<int>(std::lround(steps));
}

std::optional<double> LightFieldLayer::time_in_exposure(int tick) const {
  if (tick < kFirstInExposure) return std::nullopt;
  const double steps = tick - kFirstInExposure;
  return first_frame_ - kFramesBefore + steps / kOffsetsPerFrame;
}

store::FrameSelection LightFieldLayer::frames_of(int tick) const {
  const auto ticks = static_cast<int>(timeline_.ticks.size());
  if (tick < ticks) return timeline_.ticks[tick];
  if (const auto time = time_in_exposure(tick)) {
    return store::frames_at_time(timeline_, take_.rig(), take_time(*time));
  }
  return store::frames_at_time(timeline_, take_.rig(), take_time(first_frame_ + tick - ticks));
}

std::vector<int> LightFieldLayer::adjacent_ticks(int tick) const {
  std::vector<int> adjacent;
  for (const std::size_t found : store::adjacent_ticks(timeline_.ticks, frames_of(tick))) {
    adjacent.push_back(static_cast<int>(found));
  }
  return adjacent;
}

ShownTick LightFieldLayer::shown_tick_at(int frame, MissingFrames policy) const {
  ShownTick shown{tick_at(frame), false};
  // Also at a tick that all cameras lost. Where every camera has a frame of its own at that time,
  // the instant is a tick's.
  if (layer_.time == schemas::ShotDocument::Layer::Time::kExact) {
    if (const auto exact = exact_tick_at(frame)) shown.tick = exact;
  }
  if (shown.tick || policy != MissingFrames::kHold) return shown;
  const auto& ticks = timeline_.ticks;
  const auto after = std::upper_bound(
      ticks.begin(), ticks.end(), take_time(frame),
      [](Nanoseconds t, const store::FrameSelection& tick) { return t < tick.time_ns; });
  shown.tick = nearest_present(std::max(0, static_cast<int>(after - ticks.begin()) - 1));
  shown.held = shown.tick.has_value();
  return shown;
}

ShownTick LightFieldLayer::shown_tick_in_exposure(int frame, double offset,
                                                  const ShownTick& of_frame) const {
  if (layer_.time != schemas::ShotDocument::Layer::Time::kExact || !of_frame.tick ||
      of_frame.held) {
    return of_frame;
  }
  if (const auto exact = exact_tick_at(frame + offset)) return {exact, false};
  // The time is a tick's, or outside of the take.
  const auto tick = tick_at(frame + offset);
  return tick ? ShownTick{tick, false} : of_frame;
}

bool LightFieldLayer::moves_between(double first, double last) const {
  return layer_.time == schemas::ShotDocument::Layer::Time::kExact && timeline_.ticks.size() > 1 &&
         take_seconds(first) != take_seconds(last);
}

std::optional<int> LightFieldLayer::nearest_present(int tick) const {
  const auto present = [&](int i) { return timeline_.ticks[i].present() > 0; };
  const int count = static_cast<int>(timeline_.ticks.size());
  for (int i = tick; i >= 0; --i) {
    if (present(i)) return i;
  }
  for (int i = tick + 1; i < count; ++i) {
    if (present(i)) return i;
  }
  return std::nullopt;
}

std::string LightFieldLayer::take_duration_text() const {
  return fmt::format(
      "it lasts {:.3f} s from its first tick",
      static_cast<double>(timeline_.ticks.back().time_ns - timeline_.ticks.front().time_ns) /
          kNanosecondsPerSecond);
}

}  // namespace raystage::compose
