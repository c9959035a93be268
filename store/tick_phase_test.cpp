// SPDX-License-Identifier: Apache-2.0
#include "store/tick_phase.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace raystage::store {
namespace {

using Times = std::vector<std::vector<Nanoseconds>>;

std::vector<Nanoseconds> frames(double fps, double start_ns, int count) {
  std::vector<Nanoseconds> times;
  for (int i = 0; i < count; ++i) times.push_back(std::llround(start_ns + i * 1e9 / fps));
  return times;
}

double circular_distance(double a, double b, double period) {
  return std::abs(std::remainder(a - b, period));
}

TEST(DetectRate, ConstantRate) {
  EXPECT_NEAR(detect_frame_rate({frames(15, 0, 20), frames(15, 12'345'678, 20)}), 15, 1e-6);
  EXPECT_NEAR(detect_frame_rate({frames(30000.0 / 1001, 0, 200)}), 30000.0 / 1001, 1e-6);
}

TEST(DetectRate, DropsDoNotMatter) {
  auto times = frames(15, 0, 100);
  for (const int i : {80, 50, 49, 48, 20, 3}) times.erase(times.begin() + i);
  EXPECT_NEAR(detect_frame_rate({times}), 15, 1e-6);
  times.erase(times.begin() + 20, times.begin() + 70);  // a long gap
  EXPECT_NEAR(detect_frame_rate({times}), 15, 1e-6);
}

TEST(DetectRate, WholeMilliseconds) {
  auto times = frames(30, 0, 900);
  for (Nanoseconds& time : times) time = time / 1'000'000 * 1'000'000;
  // The median of the intervals is 33 ms, or 30.30 Hz.
  EXPECT_NEAR(detect_frame_rate({times}), 30, 2e-3);
}

TEST(DetectRate, Jitter) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> jitter(-2e6, 2e6);
  Times times;
  for (int camera = 0; camera < 16; ++camera) {
    times.push_back(frames(15, 4e6 * camera, 60));
    for (Nanoseconds& time : times.back()) time += std::llround(jitter(random));
  }
  EXPECT_NEAR(detect_frame_rate(times), 15, 0.01);
}

TEST(DetectRate, TooFewFrames) {
  EXPECT_EQ(detect_frame_rate({}), 0);
  EXPECT_EQ(detect_frame_rate({{5}, {}, {7}}), 0);
}

TEST(BestTickPhase, SynchronousCamerasGiveTheirOwn) {
  const double period = 1e9 / 15;
  for (const double start : {0.0, 1000.0, 33e6, 66'666'000.0}) {
    const Times times(8, frames(15, start, 30));
    EXPECT_LT(circular_distance(best_tick_phase(times, period), start, period), 2) << start;
  }
  EXPECT_NEAR(best_tick_phase({frames(15, 0, 30)}, period), 0, 0.5);
}

TEST(BestTickPhase, ClusteredCamerasGiveTheirMean) {
  const double period = 1e9 / 15;
  // About the wrap-around: -3, -1, +1, +3 ms.
  const Times times{frames(15, period - 3e6, 30), frames(15, period - 1e6, 30), frames(15, 1e6, 30),
                    frames(15, 3e6, 30)};
  EXPECT_LT(circular_distance(best_tick_phase(times, period), 0, period), 1e5);
}

TEST(BestTickPhase, IsCloseToTheLeastSquares) {
  std::mt19937 random(5);
  const double period = 1e9 / 15;
  for (int round = 0; round < 50; ++round) {
    std::normal_distribution<double> phase(20e6, 5e6);
    Times times;
    for (int camera = 0; camera < 16; ++camera) {
      times.push_back(frames(15, period + phase(random), 4));
    }
    const auto cost = [&](double tick) {
      double sum = 0;
      for (const auto& column : times) {
        for (const Nanoseconds time : column) {
          const double d = circular_distance(static_cast<double>(time), tick, period);
          sum += d * d;
        }
      }
      return sum;
    };
    double best = cost(0);
    for (int i = 1; i < 2000; ++i) best = std::min(best, cost(i * period / 2000));
    EXPECT_LT(cost(best_tick_phase(times, period)), best * 1.01);
  }
}

// Free-running cameras at all phases: the border between ticks is in the widest gap between their
// phases.
TEST(BestTickPhase, BorderAvoidsCameras) {
  const double period = 1e9 / 15;
  Times times;
  for (int camera = 0; camera < 64; ++camera) {
    if (camera >= 40 && camera < 44) continue;  // the gap, about phase 41.5/64
    times.push_back(frames(15, camera * period / 64, 30));
  }
  const double border = best_tick_phase(times, period) + period / 2;
  EXPECT_LT(circular_distance(border, 41.5 / 64 * period, period), period / 64);
}

}  // namespace
}  // namespace raystage::store
