// SPDX-License-Identifier: Apache-2.0
#include "simulate/exposure_schedule.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "base/error.h"
#include "base/options.h"
#include "rig/pose.h"
#include "rig/rig.h"
#include "simulate/simulated_rig.h"

namespace raystage::simulate {
namespace {

constexpr double kFrame = 1e9 / 15;

TEST(ExposureSchedule, StampsAreTrueTimesByTheClockOfTheNode) {
  SimulationOptions options;
  options.seconds = 4;
  const ExposureSchedule schedule = make_exposure_schedule(options);
  ASSERT_EQ(schedule.cameras.size(), 64U);
  ASSERT_EQ(schedule.clock_offset.size(), 4U);
  for (const Nanoseconds offset : schedule.clock_offset) EXPECT_LE(std::abs(offset), 5'000'000);
  std::set<Nanoseconds> phases;
  for (const ExposureSchedule::Camera& camera : schedule.cameras) {
    ASSERT_EQ(camera.frames.size(), 60U);
    phases.insert(camera.phase);
    EXPECT_NEAR(camera.period_ns, kFrame, kFrame * 300e-6);
    for (std::size_t i = 0; i < camera.frames.size(); ++i) {
      const ExposureSchedule::Frame& frame = camera.frames[i];
      EXPECT_EQ(frame.stamped_time - frame.true_time, schedule.clock_offset[camera.node]);
      EXPECT_GE(frame.stamped_time, 0);
      EXPECT_NEAR(static_cast<double>(frame.true_time),
                  static_cast<double>(camera.phase) + static_cast<double>(i) * camera.period_ns,
                  1.0e6);
      if (i > 0) {
        EXPECT_GT(frame.stamped_time, camera.frames[i - 1].stamped_time);
      }
      EXPECT_EQ(frame.status == store::FrameStatus::kStartUp, frame.true_time < 500'000'000);
    }
  }
  EXPECT_EQ(phases.size(), 64U) << "free running";
}

TEST(ExposureSchedule, DropsAsOftenAsAsked) {
  SimulationOptions options;
  options.seconds = 40;
  options.drop_probability = 0.1;
  int dropped = 0, due = 0;
  for (const ExposureSchedule::Camera& camera : make_exposure_schedule(options).cameras) {
    for (const ExposureSchedule::Frame& frame : camera.frames) {
      due += frame.status != store::FrameStatus::kStartUp ? 1 : 0;
      dropped += frame.status == store::FrameStatus::kDroppedBySource ? 1 : 0;
    }
  }
  EXPECT_NEAR(dropped / static_cast<double>(due), 0.1, 0.01);
}

TEST(ExposureSchedule, FollowsTheSeedAlone) {
  SimulationOptions options;
  const ExposureSchedule first = make_exposure_schedule(options),
                         second = make_exposure_schedule(options);
  options.seed = 2;
  const ExposureSchedule other = make_exposure_schedule(options);
  EXPECT_EQ(first.cameras[7].frames[9].true_time, second.cameras[7].frames[9].true_time);
  EXPECT_NE(first.cameras[7].frames[9].true_time, other.cameras[7].frames[9].true_time);
}

TEST(Array, IsBuiltWithinItsErrors) {
  SimulationOptions options;
  options.photometric_deviation = 0.05;
  const SimulatedRig array = make_simulated_rig(options);
  const rig::Rig nominal = rig::rig_from_document(array.nominal),
                 truth = rig::rig_from_document(array.truth);
  ASSERT_EQ(truth.cameras.size(), 64U);
  double farthest = 0, most_turned = 0;
  for (std::size_t i = 0; i < 64; ++i) {
    farthest = std::max(farthest,
                        (truth.cameras[i].pose.position - nominal.cameras[i].pose.position).norm());
    const double cosine = ((truth.cameras[i].pose.world_from_camera_rotation.trace() - 1) / 2);
    most_turned = std::max(most_turned, std::acos(std::min(1.0, cosine)) * 180 / M_PI);
    EXPECT_NE(truth.cameras[i].photometric, schemas::PhotometricResponse{});
    EXPECT_EQ(nominal.cameras[i].photometric, schemas::PhotometricResponse{});
  }
  EXPECT_LE(farthest, 0.003);
  EXPECT_GT(farthest, 0.002);
  EXPECT_LE(most_turned, 0.6 + 1e-6);
  EXPECT_GT(most_turned, 0.4);
  // Row 0 on top, column 0 on the left; the array's middle at the origin.
  EXPECT_NEAR((nominal.cameras[0].pose.position - Eigen::Vector3d(-0.21, 0.21, 0)).norm(), 0,
              1e-12);
  EXPECT_NEAR(nominal.centre().norm(), 0, 1e-12);
}

TEST(SimulationOptions, RefusesWhatCannotBe) {
  const auto refused = [](const auto& change) {
    SimulationOptions options;
    change(options);
    try {
      require_valid(options, "simulation");
    } catch (const Error& error) {
      return error.exit_code() == ExitCode::kBadInput;
    }
    return false;
  };
  EXPECT_FALSE(refused([](SimulationOptions&) {}));
  EXPECT_TRUE(refused([](SimulationOptions& s) { s.rows = 0; }));
  EXPECT_TRUE(refused([](SimulationOptions& s) { s.fps = std::nan(""); }));
  EXPECT_TRUE(refused([](SimulationOptions& s) { s.seconds = 0; }));
  EXPECT_TRUE(refused([](SimulationOptions& s) { s.edge_samples = 5; }));
  EXPECT_TRUE(refused([](SimulationOptions& s) { s.horizontal_fov_deg = 180; }));
  EXPECT_TRUE(refused([](SimulationOptions& s) { s.drop_probability = -0.1; }));
}

}  // namespace
}  // namespace raystage::simulate
