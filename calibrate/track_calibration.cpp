// SPDX-License-Identifier: Apache-2.0
// Alternates between a calibration (calibrate()) and the estimation of clock offsets until they
// converge, or six times. Each point gives an offset: the reprojection error along the motion of
// the target divided by its speed in the picture. The offset of a camera is their median, weighted
// by speed squared. Inputs: tracks per camera, pixels and ns. Cost: one bundle adjustment per
// round.
#include "calibrate/track_calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calibrate/geometry/median.h"

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

}  // namespace

TrackCalibration calibrate_from_tracks(const RecordedTracks& light,
                                       const TrackCalibrationOptions& options) {
  PointTracks tracks = light.tracks;
  TrackCalibration result;
  result.clock_offsets.assign(tracks.size(), 0);
  CalibrationOptions calibration = options.calibration;
  const double speed = median_speed(tracks);
  for (int round = 0;; ++round) {
    result.points = interpolate_tracks(tracks, light.cameras, light.period, options.points);
    result.calibration = calibrate(result.points.detections, calibration);
    if (!options.estimates_clock_offsets || round == kMaxRounds) break;
    const std::vector<double> ahead =
        remaining_offsets(result.calibration.model, result.points, tracks);
    double most = 0;
    for (std::size_t c = 0; c < tracks.size(); ++c) {
      const auto offset = static_cast<Nanoseconds>(std::llround(ahead[c] * kNsPerS));
      result.clock_offsets[c] += offset;
      for (PointTrack& track : tracks[c]) {
        for (PointTrack::FrameDetection& detection : track.frame_detections)
          detection.time -= offset;
      }
      most = std::max(most, std::abs(ahead[c]));
    }
    constexpr double kSettled = 0.02;  // pixels
    if (most * speed <= kSettled) break;
    calibration = continued(options.calibration, result.calibration);
  }
  return result;
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
