// SPDX-License-Identifier: Apache-2.0
// Calibrates from simulated tracks of a moving light: free-running cameras with wrong clocks,
// without pictures.
#include "calibrate/track_calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "rig/row_times.h"
#include "testing/calibrate/test_synthetic_array.h"

namespace raystage::calibrate {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr Nanoseconds kPeriod = 100'000'000;

Vector3d light_at(double seconds) {
  const double away = 1.7 + 0.85 * std::sin(0.47 * seconds + 0.4);
  return {0.56 * away * std::sin(1.31 * seconds), 0.4 * away * std::sin(1.87 * seconds + 1), -away};
}

struct Recording {
  RecordedTracks light;
  std::vector<rig::Pose> poses;
  std::vector<double> clock_ms;  // ahead of the true time
};

/// `line_times_us`: of the cameras in turn.
Recording recorded(double most_clock_ms, double noise_px,
                   const std::vector<double>& line_times_us = {0}) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> share(-1, 1);
  std::normal_distribution<double> normal;
  Recording recording;
  recording.poses =
      testing::make_synthetic_array({.rows = 3, .columns = 3, .mounting_deg = 8, .points = 1})
          .poses;
  recording.light.period = kPeriod;
  for (std::size_t c = 0; c < recording.poses.size(); ++c) {
    const std::string id = fmt::format("c{}", c);
    const rig::CameraModel lens({id, 640, 480, {530, 530, 322, 238, {}}, {}, {}, {}});
    const double clock = most_clock_ms * share(random), phase = 50 * (1 + share(random));
    PointTrack track;
    for (int i = 0; i < 150; ++i) {
      const double exposed_ms = phase + i * 100.0;
      const auto seen_at = [&](double ms) {
        return lens.project(recording.poses[c].camera_from_world(light_at(ms / 1000)));
      };
      auto pixel = seen_at(exposed_ms);
      // The row at which the light is decides when it is exposed.
      for (int k = 0; k < 8 && pixel; ++k) {
        const double line_time_us = line_times_us[c % line_times_us.size()];
        pixel = seen_at(exposed_ms + 1e-3 * rig::row_time(line_time_us, 480, pixel->y()));
      }
      PointTrack::FrameDetection detection{std::llround((exposed_ms + clock) * 1e6), {}};
      if (pixel && lens.contains(*pixel)) {
        detection.spot.result = LightDetectionStatus::kFound;
        detection.spot.centre = *pixel + noise_px * Vector2d(normal(random), normal(random));
      }
      track.frame_detections.push_back(detection);
    }
    recording.light.tracks.push_back({std::move(track)});
    recording.light.cameras.push_back({id, 640, 480});
    recording.clock_ms.push_back(clock);
  }
  return recording;
}

TrackCalibration calibrated(const Recording& recording, bool estimates_clock_offsets) {
  TrackCalibrationOptions options;
  options.estimates_clock_offsets = estimates_clock_offsets;
  options.calibration.scale.spacing_m = 0.06;
  options.calibration.solve.horizontal_fov = 60 * testing::kTestDegree;
  return calibrate_from_tracks(recording.light, options);
}

TEST(InterpolatedTracks, AreAtCommonTimes) {
  const Recording recording = recorded(0, 0);
  const InterpolatedTracks points =
      interpolate_tracks(recording.light.tracks, recording.light.cameras, kPeriod, {});
  ASSERT_GT(points.detections.detections.size(), 500U);
  double worst = 0;
  for (const Detections::Detection& d : points.detections.detections) {
    const double seconds = 1e-9 * static_cast<double>(points.begin + d.point * kPeriod);
    const rig::CameraModel lens({"c", 640, 480, {530, 530, 322, 238, {}}, {}, {}, {}});
    const auto there = lens.project(recording.poses[d.camera].camera_from_world(light_at(seconds)));
    ASSERT_TRUE(there);
    worst = std::max(worst, (d.pixel - *there).norm());
  }
  EXPECT_LE(worst, 0.3);
}

TEST(InterpolatedTracks, AreNotMadeUpWhereTheLightWasNotSeen) {
  Recording recording = recorded(0, 0);
  for (auto& of_camera : recording.light.tracks) {
    for (std::size_t i = 40; i < 60; ++i)
      of_camera[0].frame_detections[i].spot.result = LightDetectionStatus::kDark;
  }
  const InterpolatedTracks points =
      interpolate_tracks(recording.light.tracks, recording.light.cameras, kPeriod, {});
  for (const Detections::Detection& d : points.detections.detections) {
    EXPECT_TRUE(d.point < 41 || d.point > 58) << d.point;
  }
}

TEST(InterpolatedTracks, AreSpreadOverTheRecording) {
  const Recording recording = recorded(0, 0);
  TrackInterpolationOptions options;
  options.max_points = 20;
  const InterpolatedTracks points =
      interpolate_tracks(recording.light.tracks, recording.light.cameras, kPeriod, options);
  std::set<int> ticks;
  for (const Detections::Detection& d : points.detections.detections) ticks.insert(d.point);
  EXPECT_EQ(ticks.size(), 20U);
  EXPECT_LT(*ticks.begin(), 15);
  EXPECT_GT(*ticks.rbegin(), 130);
  // A light at rest counts as one point.
  PointTrack rests;
  for (int i = 0; i < 50; ++i) {
    rests.frame_detections.push_back({i * kPeriod, {LightDetectionStatus::kFound, {50, 50}, 1, 9}});
  }
  const InterpolatedTracks resting =
      interpolate_tracks({{rests}, {rests}}, {{"a", 640, 480}, {"b", 640, 480}}, kPeriod, {});
  EXPECT_EQ(resting.detections.detections.size(), 2U);
}

TEST(LightCalibrations, SetTheClocksToo) {
  const Recording recording = recorded(8, 0.1);
  const TrackCalibration found = calibrated(recording, true);
  double mean = 0;
  for (const double clock : recording.clock_ms) mean += clock / 9;
  for (std::size_t c = 0; c < 9; ++c) {
    EXPECT_NEAR(1e-6 * static_cast<double>(found.clock_offsets[c]), recording.clock_ms[c] - mean,
                0.1)
        << c;
  }
  const testing::PoseErrors errors = testing::pose_errors(found.calibration.model, recording.poses);
  EXPECT_LE(errors.metres, 0.001);
  EXPECT_LE(errors.degrees, 0.05);
  EXPECT_LE(rms_reprojection_error(found.calibration.model), 0.2);
  EXPECT_TRUE(found.calibration.verdict.is_accepted())
      << ::testing::PrintToString(found.calibration.verdict.reasons);
}

// 15 ms from the first to the last of 480 rows.
TEST(LightCalibrations, FindTheLineTime) {
  for (const double line_time_us : {31.25, -31.25}) {
    const Recording recording = recorded(8, 0.05, {line_time_us});
    const TrackCalibration found = calibrated(recording, true);
    const LineTimes& lines = found.calibration.line_times;
    ASSERT_EQ(lines.cameras.size(), 9U);
    for (const LineTimes::Camera& camera : lines.cameras) {
      EXPECT_EQ(camera.source, LineTimes::Source::kFoundCommon);
      EXPECT_NEAR(camera.us, line_time_us, 0.03 * 31.25);
      EXPECT_NEAR(camera.us, line_time_us, 4 * camera.deviation_us);
      EXPECT_LT(camera.deviation_us, 0.02 * 31.25);
    }
    const testing::PoseErrors errors =
        testing::pose_errors(found.calibration.model, recording.poses);
    EXPECT_LE(errors.metres, 0.001);
    EXPECT_LE(rms_reprojection_error(found.calibration.model), 0.2);
    EXPECT_TRUE(found.calibration.verdict.is_accepted())
        << ::testing::PrintToString(found.calibration.verdict.reasons);
    const schemas::RigDocument rig = make_rig_document(found.calibration, std::nullopt, "test");
    EXPECT_EQ(rig.cameras[4].geometry.line_time_us, lines.cameras[4].us);
    EXPECT_THAT(format_line_times(lines, found.calibration.model),
                ::testing::HasSubstr("9 cameras: rolling, one value found, line time"));
  }
}

TEST(LightCalibrations, FindLineTimesOfMixedCameras) {
  const std::vector<double> true_us{0, 31.25, 62.5};
  const TrackCalibration found = calibrated(recorded(0, 0.05, true_us), true);
  for (std::size_t c = 0; c < 9; ++c) {
    const LineTimes::Camera& camera = found.calibration.line_times.cameras[c];
    EXPECT_NEAR(camera.us, true_us[c % 3], 2) << c;
    EXPECT_EQ(camera.source,
              c % 3 == 0 ? LineTimes::Source::kInsignificant : LineTimes::Source::kFound)
        << c;
  }
}

TEST(LightCalibrations, UseLineTimesThatAreGiven) {
  Recording recording = recorded(0, 0.1, {31.25});
  recording.light.line_times_us.assign(9, 31.25);
  const TrackCalibration found = calibrated(recording, true);
  EXPECT_EQ(found.calibration.line_times.cameras[3].source, LineTimes::Source::kGiven);
  EXPECT_EQ(make_rig_document(found.calibration, std::nullopt, "").cameras[3].geometry.line_time_us,
            31.25);
  EXPECT_LE(rms_reprojection_error(found.calibration.model), 0.2);
}

TEST(LightCalibrations, DoNotFindALineTimeOfGlobalShutters) {
  const TrackCalibration found = calibrated(recorded(8, 0.1), true);
  for (const LineTimes::Camera& camera : found.calibration.line_times.cameras) {
    EXPECT_EQ(camera.us, 0);
    EXPECT_LT(std::abs(camera.estimate_us), 5 * camera.deviation_us);
  }
}

TEST(LightCalibrations, WithWrongClocksAreNotVouchedFor) {
  const TrackCalibration found = calibrated(recorded(8, 0.1), false);
  EXPECT_FALSE(found.calibration.verdict.is_accepted());
  EXPECT_EQ(found.clock_offsets, std::vector<Nanoseconds>(9, 0));
}

}  // namespace
}  // namespace raystage::calibrate
