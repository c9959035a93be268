// SPDX-License-Identifier: Apache-2.0
// Alternates between a calibration (calibrate()) and the estimation of clock offsets until they
// converge, or six times. Each point gives an offset: the reprojection error along the motion of
// the target divided by its speed in the picture. The offset of a camera is their median, weighted
// by speed squared. Then line times are estimated, the times of the detections are corrected by
// them, and all of it is repeated until they converge. Inputs: tracks per camera, pixels and ns.
// Cost: one bundle adjustment per round.
#include "calibrate/track_calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calibrate/geometry/line_times.h"
#include "calibrate/geometry/median.h"
#include "calibrate/geometry/time_correction.h"
#include "rig/row_times.h"

namespace raystage::calibrate {
namespace {

using Eigen::Vector2d;

constexpr int kMaxRounds = 6;

/// Estimate of a camera's clock offset from one point.
struct Lag {
  double seconds = 0;  // by which the camera's times are ahead
  double weight = 0;   // pixels per second, squared
};

double weighted_median(std::vector<Lag> lags) {
  std::ranges::sort(lags, {}, &Lag::seconds);
  double half = 0;
  for (const Lag& lag : lags) half += lag.weight / 2;
  for (const Lag& lag : lags) {
    half -= lag.weight;
    if (half <= 0) return lag.seconds;
  }
  return 0;
}

std::vector<std::vector<Lag>> lags_of(const ArrayModel& model, const InterpolatedTracks& points,
                                      const PointTracks& tracks) {
  constexpr double kMaxDeviation = 30;  // pixels; larger errors are another light
  constexpr double kMinSpeed = 10;      // pixels per second
  const CameraModels lenses = camera_models(model);
  std::vector<std::vector<Lag>> lags(tracks.size());
  for (const ArrayModel::Observation& o : model.observations) {
    const auto off = reprojection_residual(model, lenses, o);
    if (!off || !(off->norm() <= kMaxDeviation)) continue;
    const int number = model.point_ids[o.point];
    const auto target = static_cast<std::size_t>(number % points.targets);
    const auto speed =
        track_velocity(tracks[o.camera][target],
                       points.begin + number / points.targets * points.period, points.period);
    if (!speed || !(speed->norm() >= kMinSpeed)) continue;
    const double weight = speed->squaredNorm();
    lags[o.camera].push_back({-speed->dot(*off) / weight, weight});
  }
  return lags;
}

/// Returns the seconds by which each camera's times are ahead; mean 0 over the cameras with enough
/// points.
std::vector<double> remaining_offsets(const ArrayModel& model, const InterpolatedTracks& points,
                                      const PointTracks& tracks) {
  constexpr std::size_t kMin = 10;  // points
  const auto lags = lags_of(model, points, tracks);
  std::vector<double> offsets(tracks.size(), 0);
  double sum = 0;
  int count = 0;
  for (std::size_t c = 0; c < offsets.size(); ++c) {
    if (lags[c].size() < kMin) continue;
    offsets[c] = weighted_median(lags[c]);
    sum += offsets[c];
    ++count;
  }
  for (std::size_t c = 0; c < offsets.size(); ++c) {
    if (lags[c].size() >= kMin) offsets[c] -= sum / count;
  }
  return offsets;
}

/// Returns the median speed of the light in the pictures, pixels per second.
double median_speed(const PointTracks& tracks) {
  std::vector<double> speeds;
  for (const auto& of_camera : tracks) {
    if (of_camera.empty()) continue;
    const auto& frame_detections = of_camera[of_camera.size() / 2].frame_detections;
    for (std::size_t i = 1; i < frame_detections.size(); ++i) {
      const PointTrack::FrameDetection &before = frame_detections[i - 1],
                                       &after = frame_detections[i];
      if (before.spot.result != LightDetectionStatus::kFound ||
          after.spot.result != LightDetectionStatus::kFound || after.time <= before.time) {
        continue;
      }
      speeds.push_back((after.spot.centre - before.spot.centre).norm() * kNsPerS /
                       static_cast<double>(after.time - before.time));
    }
  }
  return speeds.empty() ? 0 : median(std::move(speeds));
}

/// Returns settings that start from the poses and lenses of a calibration.
CalibrationOptions continued(const CalibrationOptions& options, const Calibration& found) {
  CalibrationOptions next = options;
  if (options.start) return next;
  next.solve.lenses.clear();
  next.solve.poses.clear();
  for (const ArrayModel::Camera& camera : found.model.cameras) {
    next.solve.lenses.push_back(camera.intrinsics);
    next.solve.poses.push_back(camera.pose);
  }
  return next;
}

/// Calibrates from tracks whose times it corrects.
class TimedCalibration {
 public:
  TimedCalibration(const RecordedTracks& light, const TrackCalibrationOptions& options)
      : light_(light), options_(options), tracks_(light.tracks) {
    const std::size_t cameras = tracks_.size();
    line_times_us_.assign(cameras, 0);
    result_.clock_offsets.assign(cameras, 0);
    for (std::size_t c = 0; c < cameras; ++c) {
      const double known = known_line_time(c);
      is_given_.push_back(known != 0);
      add_line_time(c, known);
    }
  }

  TrackCalibration run() {
    constexpr int kMaxLineTimeRounds = 6;
    settle_clocks(options_.calibration);
    for (int round = 0; round < kMaxLineTimeRounds && estimate_line_times(); ++round) {
      settle_clocks(continued(options_.calibration, result_.calibration));
    }
    const bool is_any_given = std::ranges::find(is_given_, true) != is_given_.end();
    if (line_times_.cameras.empty() && is_any_given) {
      for (std::size_t c = 0; c < is_given_.size(); ++c) {
        line_times_.cameras.push_back(
            {is_given_[c] ? LineTimes::Source::kGiven : LineTimes::Source::kNone, line_times_us_[c],
             line_times_us_[c], 0});
      }
    }
    result_.calibration.line_times = line_times_;
    return std::move(result_);
  }

 private:
  double known_line_time(std::size_t camera) const {
    const auto& start = options_.calibration.start;
    const auto* known = start ? start->find(light_.cameras[camera].id) : nullptr;
    if (known != nullptr && known->geometry.line_time_us != 0) return known->geometry.line_time_us;
    return camera < light_.line_times_us.size() ? light_.line_times_us[camera] : 0;
  }

  void add_line_time(std::size_t camera, double line_time_us) {
    line_times_us_[camera] += line_time_us;
    if (line_time_us == 0) return;
    const int height = light_.cameras[camera].height;
    for (PointTrack& track : tracks_[camera]) {
      for (PointTrack::FrameDetection& detection : track.frame_detections) {
        if (detection.spot.result != LightDetectionStatus::kFound) continue;
        detection.time += rig::row_time_ns(line_time_us, height, detection.spot.centre.y());
      }
    }
  }

  void add_clock_offset(std::size_t camera, double seconds) {
    const auto offset = static_cast<Nanoseconds>(std::llround(seconds * kNsPerS));
    result_.clock_offsets[camera] += offset;
    for (PointTrack& track : tracks_[camera]) {
      for (PointTrack::FrameDetection& detection : track.frame_detections) detection.time -= offset;
    }
  }

  /// Solves, and corrects the clocks until they no longer change.
  void settle_clocks(CalibrationOptions calibration) {
    const double speed = median_speed(tracks_);
    for (int round = 0;; ++round) {
      result_.points = interpolate_tracks(tracks_, light_.cameras, light_.period, options_.points);
      result_.calibration = calibrate(result_.points.detections, calibration);
      if (!options_.estimates_clock_offsets || round == kMaxRounds) break;
      const std::vector<double> ahead =
          remaining_offsets(result_.calibration.model, result_.points, tracks_);
      double most = 0;
      for (std::size_t c = 0; c < tracks_.size(); ++c) {
        add_clock_offset(c, ahead[c]);
        most = std::max(most, std::abs(ahead[c]));
      }
      constexpr double kSettled = 0.02;  // pixels
      if (most * speed <= kSettled) break;
      calibration = continued(options_.calibration, result_.calibration);
    }
  }

  std::vector<std::optional<Vector2d>> velocities() const {
    const ArrayModel& model = result_.calibration.model;
    const InterpolatedTracks& points = result_.points;
    std::vector<std::optional<Vector2d>> velocities;
    for (const ArrayModel::Observation& o : model.observations) {
      const int number = model.point_ids[o.point];
      const auto target = static_cast<std::size_t>(number % points.targets);
      velocities.push_back(track_velocity(tracks_[o.camera][target],
                                          points.begin + number / points.targets * points.period,
                                          points.period));
    }
    return velocities;
  }

  /// Estimates the line times and corrects the times by them. Returns whether they have changed.
  bool estimate_line_times() {
    const bool is_board = !options_.calibration.board.empty();
    if (!options_.estimates_line_times || is_board) return false;
    const ArrayModel& model = result_.calibration.model;
    TimeCorrectionOptions times;
    times.estimates_clocks = options_.estimates_clock_offsets;
    for (const bool is_given : is_given_) times.estimates_line_time.push_back(!is_given);
    const auto correction =
        estimate_time_correction(model, result_.calibration.solve.last, velocities(), times);
    if (!correction) return false;
    line_times_ = choose_line_times(model, line_times_us_, is_given_, *correction);
    bool has_changed = false;
    std::vector<double> change;
    for (std::size_t c = 0; c < line_times_us_.size(); ++c) {
      const double used = is_given_[c] ? line_times_us_[c] : line_times_.cameras[c].us;
      change.push_back(used - line_times_us_[c]);
      constexpr double kSettled = 1e-3;
      has_changed = has_changed || std::abs(change[c]) > kSettled * std::abs(used);
    }
    if (!has_changed) return false;
    for (std::size_t c = 0; c < change.size(); ++c) {
      add_line_time(c, change[c]);
      if (options_.estimates_clock_offsets) add_clock_offset(c, correction->clock_s[c]);
    }
    return true;
  }

  const RecordedTracks& light_;
  const TrackCalibrationOptions& options_;
  PointTracks tracks_;
  std::vector<double> line_times_us_;  // that the times of tracks_ have
  std::vector<bool> is_given_;
  LineTimes line_times_;
  TrackCalibration result_;
};

}  // namespace

TrackCalibration calibrate_from_tracks(const RecordedTracks& light,
                                       const TrackCalibrationOptions& options) {
  return TimedCalibration(light, options).run();
}

std::string format_clock_offsets(const TrackCalibration& found,
                                 const std::vector<schemas::DetectionsDocument::Camera>& cameras) {
  const auto most = std::ranges::max_element(found.clock_offsets, {},
                                             [](Nanoseconds offset) { return std::abs(offset); });
  if (most == found.clock_offsets.end()) return {};
  return fmt::format(
      "Clocks     set from the motion of the light; largest offset: {} by {:.2f} ms\n",
      cameras[most - found.clock_offsets.begin()].id, static_cast<double>(*most) / kNsPerMs);
}

}  // namespace raystage::calibrate
