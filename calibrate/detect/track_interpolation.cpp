// SPDX-License-Identifier: Apache-2.0
// Interpolates tracks of free-running cameras at common times: Newton's polynomial through up to
// two detections on each side (cubic or parabola). A point is rejected if it differs from linear
// interpolation by more than `max_curvature_px`. Instants are then thinned by motion and number.
// Output: pixels per camera and tick. Cost: ticks times cameras times targets.
#include "calibrate/detect/track_interpolation.h"

#include <algorithm>
#include <limits>
#include <span>

#include "base/options.h"
#include "calibrate/geometry/median.h"

namespace raystage::calibrate {
namespace {

using Eigen::Vector2d;
using FrameDetection = PointTrack::FrameDetection;

bool is_found(const FrameDetection& detection) {
  return detection.spot.result == LightDetectionStatus::kFound;
}

/// Evaluates Newton's interpolation polynomial through up to four detections.
Vector2d interpolated(std::span<const FrameDetection> frame_detections, Nanoseconds time,
                      double period) {
  std::array<Vector2d, 4> difference;
  std::array<double, 4> at{};
  for (std::size_t i = 0; i < frame_detections.size(); ++i) {
    difference[i] = frame_detections[i].spot.centre;
    at[i] = static_cast<double>(frame_detections[i].time - time) / period;
  }
  for (std::size_t step = 1; step < frame_detections.size(); ++step) {
    for (std::size_t i = frame_detections.size() - 1; i >= step; --i) {
      difference[i] = (difference[i] - difference[i - 1]) / (at[i] - at[i - step]);
    }
  }
  Vector2d value = difference[frame_detections.size() - 1];
  for (std::size_t i = frame_detections.size() - 1; i-- > 0;) value = difference[i] - at[i] * value;
  return value;
}

/// Returns the interpolated position at a time; none without detections before and after it, or if
/// the path is too curved.
std::optional<Vector2d> seen_at(const std::vector<FrameDetection>& frame_detections,
                                Nanoseconds time, Nanoseconds period, double max_curvature_px) {
  const auto after = std::ranges::lower_bound(frame_detections, time, {}, &FrameDetection::time);
  const auto index = after - frame_detections.begin();
  const auto count = static_cast<std::ptrdiff_t>(frame_detections.size());
  if (index < count && after->time == time && is_found(*after)) return after->spot.centre;
  if (index == 0 || index == count) return std::nullopt;
  const auto at = [&](std::ptrdiff_t i) -> const FrameDetection& { return frame_detections[i]; };
  const auto bridged = [&](std::ptrdiff_t before) {
    return before >= 0 && before + 1 < count && is_found(at(before)) && is_found(at(before + 1)) &&
           2 * (at(before + 1).time - at(before).time) <= 3 * period;
  };
  if (!bridged(index - 1)) return std::nullopt;
  const auto between = [&](std::ptrdiff_t first, std::ptrdiff_t last) {
    return std::span(frame_detections)
        .subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(last - first + 1));
  };
  const auto scale = static_cast<double>(period);
  const Vector2d on_line = interpolated(between(index - 1, index), time, scale);
  const std::ptrdiff_t first = bridged(index - 2) ? index - 2 : index - 1;
  const std::ptrdiff_t last = bridged(index) ? index + 1 : index;
  // Two detections alone cannot check the curvature.
  if (first == index - 1 && last == index) return std::nullopt;
  const Vector2d on_curve = interpolated(between(first, last), time, scale);
  if (!((on_curve - on_line).norm() <= max_curvature_px)) return std::nullopt;
  return on_curve;
}

using Seen = std::vector<std::optional<Vector2d>>;  // by camera, then by target

int count_observations(const Seen& seen) {
  return static_cast<int>(
      std::ranges::count_if(seen, [](const auto& place) { return place.has_value(); }));
}

int count_cameras(const Seen& seen, std::size_t targets) {
  int cameras = 0;
  for (std::size_t i = 0; i < seen.size(); i += targets) {
    const auto of_camera = std::span(seen).subspan(i, targets);
    cameras +=
        std::ranges::any_of(of_camera, [](const auto& at) { return at.has_value(); }) ? 1 : 0;
  }
  return cameras;
}

/// Returns whether the light has moved, by the median over the cameras that see it at both times.
bool has_moved(const Seen& before, const Seen& now, double least_px) {
  std::vector<double> steps;
  for (std::size_t c = 0; c < now.size(); ++c) {
    if (before[c] && now[c]) steps.push_back((*now[c] - *before[c]).norm());
  }
  return steps.empty() || median(std::move(steps)) >= least_px;
}

struct Instant {
  int number = 0;
  Seen seen;
};

/// Returns the median motion of the targets until a later time, pixels, over those with both
/// positions.
double median_step(const PointTracks& tracks, const Seen& now, Nanoseconds later,
                   Nanoseconds period) {
  std::vector<double> steps;
  std::size_t at = 0;
  for (const auto& of_camera : tracks) {
    for (const PointTrack& track : of_camera) {
      const auto& here = now[at++];
      const double any_bend = std::numeric_limits<double>::infinity();
      const auto there = seen_at(track.frame_detections, later, period, any_bend);
      if (here && there) steps.push_back((*there - *here).norm());
    }
  }
  if (steps.empty()) return std::numeric_limits<double>::infinity();
  return median(std::move(steps));
}

/// Returns the half of the instants at which targets move least.
std::vector<Instant> at_rest(const std::vector<Instant>& all, const PointTracks& tracks,
                             const InterpolatedTracks& points) {
  std::vector<double> steps;
  for (const Instant& instant : all) {
    const Nanoseconds time = points.begin + instant.number * points.period;
    steps.push_back(median_step(tracks, instant.seen, time + points.period / 4, points.period));
  }
  const double limit = median(steps);
  std::vector<Instant> slow;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (steps[i] <= limit) slow.push_back(all[i]);
  }
  return slow;
}

/// Returns, from each of `most` equal parts of the list, the instant with the most detections.
std::vector<Instant> spread(std::vector<Instant> all, std::size_t most) {
  if (all.size() <= most) return all;
  std::vector<Instant> chosen;
  for (std::size_t part = 0; part < most; ++part) {
    const auto begin = all.begin() + (part * all.size() / most);
    const auto end = all.begin() + ((part + 1) * all.size() / most);
    chosen.push_back(*std::max_element(begin, end, [](const Instant& a, const Instant& b) {
      return count_observations(a.seen) < count_observations(b.seen);
    }));
  }
  return chosen;
}

}  // namespace

bool TrackInterpolationOptions::is_valid(std::string* reason) const {
  return is_within("points", max_points, 1, 1e9, reason) &&
         is_within("step (pixels)", min_step_px, 0, 1e6, reason) &&
         is_within("curvature (pixels)", max_curvature_px, 0, 1e6, reason);
}

InterpolatedTracks interpolate_tracks(
    const PointTracks& tracks, const std::vector<schemas::DetectionsDocument::Camera>& cameras,
    Nanoseconds period, const TrackInterpolationOptions& options) {
  require_valid(options, "interpolation of tracks");
  const std::size_t targets = tracks.empty() ? 1 : tracks.front().size();
  InterpolatedTracks points{{cameras, {}}, static_cast<int>(targets), 0, period};
  std::optional<Nanoseconds> begin, end;
  for (const auto& of_camera : tracks) {
    for (const PointTrack& track : of_camera) {
      if (track.frame_detections.empty()) continue;
      begin = std::min(begin.value_or(track.frame_detections.front().time),
                       track.frame_detections.front().time);
      end = std::max(end.value_or(track.frame_detections.back().time),
                     track.frame_detections.back().time);
    }
  }
  if (!begin || period <= 0) return points;
  points.begin = *begin;
  std::vector<Instant> instants;
  int number = 0;
  for (Nanoseconds time = *begin; time <= *end; time += period, ++number) {
    Instant instant{number, {}};
    for (const auto& of_camera : tracks) {
      for (const PointTrack& track : of_camera) {
        instant.seen.push_back(
            seen_at(track.frame_detections, time, period, options.max_curvature_px));
      }
    }
    if (count_cameras(instant.seen, targets) < 2) continue;
    if (!instants.empty() && !has_moved(instants.back().seen, instant.seen, options.min_step_px)) {
      continue;
    }
    instants.push_back(std::move(instant));
  }
  if (options.prefers_still_instants && !instants.empty())
    instants = at_rest(instants, tracks, points);
  for (const Instant& instant :
       spread(std::move(instants), static_cast<std::size_t>(options.max_points))) {
    for (std::size_t target = 0; target < targets; ++target) {
      for (std::size_t c = 0; c < tracks.size(); ++c) {
        const auto& seen = instant.seen[c * targets + target];
        if (!seen) continue;
        points.detections.detections.push_back(
            {static_cast<int>(c), instant.number * points.targets + static_cast<int>(target),
             *seen});
      }
    }
  }
  return points;
}

std::optional<Vector2d> track_velocity(const PointTrack& track, Nanoseconds time,
                                       Nanoseconds period) {
  const double most_bend = std::numeric_limits<double>::infinity();
  const Nanoseconds step = period / 10;
  const auto before = seen_at(track.frame_detections, time - step, period, most_bend);
  const auto after = seen_at(track.frame_detections, time + step, period, most_bend);
  if (!before || !after) return std::nullopt;
  return (*after - *before) / (2e-9 * step);
}

}  // namespace raystage::calibrate
