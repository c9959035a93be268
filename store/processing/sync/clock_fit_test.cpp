// SPDX-License-Identifier: Apache-2.0
#include "store/processing/sync/clock_fit.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <set>

#include "store/processing/sync/clock_steps.h"
#include "testing/store/simulated_stamps.h"

namespace raystage::store {
namespace {

using testing::SimulatedStamps;
using Jitter = SimulatedStamps::Jitter;
using Options = SimulatedStamps::Options;

ClockFits fits_of(const SimulatedStamps& truth, const ClockFitOptions& options = {}) {
  std::vector<std::vector<double>> times;
  std::vector<int> group;
  for (const auto& camera : truth.cameras) {
    times.emplace_back(camera.stamps.begin(), camera.stamps.end());
    group.push_back(camera.node);
  }
  return fit_clocks(times, group, options);
}

// Returns the Cramer-Rao bound of each camera's period, ppm^2: the least variance of any unbiased
// estimate. Time stamps are Gaussian with known sigma, and their node clock steps by an unknown
// amount.
std::vector<double> least_variance(const SimulatedStamps& truth, const Options& s) {
  struct Information {
    double n = 0, x = 0, xx = 0, h = 0, hx = 0;
    double solve_slope(double a, double b) const { return (n * b - x * a) / (n * xx - x * x); }
    double solve_level(double a, double b) const { return (xx * a - x * b) / (n * xx - x * x); }
  };
  std::vector<Information> cameras;
  std::map<int, double> of_step;
  for (const auto& camera : truth.cameras) {
    Information i;
    for (std::size_t f = 0; f < camera.index.size(); ++f) {
      const auto x = static_cast<double>(camera.index[f]) - 450;
      const double h =
          camera.node == s.step_node && static_cast<double>(camera.exposed[f]) >= s.step_at_s * 1e9
              ? 1
              : 0;
      i.n += 1;
      i.x += x;
      i.xx += x * x;
      i.h += h;
      i.hx += h * x;
    }
    of_step[camera.node] += i.h - i.h * i.solve_level(i.h, i.hx) - i.hx * i.solve_slope(i.h, i.hx);
    cameras.push_back(i);
  }
  std::vector<double> variances;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const Information& i = cameras[c];
    double variance = i.solve_slope(0, 1);
    if (i.h > 0) {
      const double slope = i.solve_slope(i.h, i.hx);
      variance += slope * slope / of_step[truth.cameras[c].node];
    }
    const double sigma = s.jitter_ms * 1e6 / truth.cameras[c].period * 1e6;
    variances.push_back(variance * sigma * sigma);
  }
  return variances;
}

struct Errors {
  double square_ppm = 0, bound_square_ppm = 0, largest_ppm = 0, largest_phase_ms = 0;
  double step_ms = 0;  ///< largest error of the step
  int within_two_ppm = 0;
  int cameras = 0, miscounted = 0, without_slot = 0, outliers = 0, steps = 0, own_breaks = 0;
  ClockFitMethod method = ClockFitMethod::kLeastSquares;
  double rms_ppm() const { return std::sqrt(square_ppm / cameras); }
  double bound_ppm() const { return std::sqrt(bound_square_ppm / cameras); }
};

void add_errors(const Options& s, Errors& sum, const ClockFitOptions& fit_options = {}) {
  const SimulatedStamps truth(s);
  const ClockFits fits = fits_of(truth, fit_options);
  const std::vector<double> bounds = least_variance(truth, s);
  sum.method = fits.method;
  for (std::size_t c = 0; c < truth.cameras.size(); ++c) {
    const ClockFit& fit = fits.cameras[c];
    const auto& camera = truth.cameras[c];
    ASSERT_TRUE(fit.regular) << c;
    const double ppm = (fit.lattice.period / camera.period - 1) * 1e6;
    sum.square_ppm += ppm * ppm;
    sum.bound_square_ppm += bounds[c];
    sum.largest_ppm = std::max(sum.largest_ppm, std::abs(ppm));
    sum.within_two_ppm += std::abs(ppm) < 2 ? 1 : 0;
    ++sum.cameras;
    const std::size_t middle = camera.stamps.size() / 2;
    const auto zero = fit.slots[middle] - camera.index[middle];
    // The phase in the middle of the take, where it does not depend on the period.
    const double phase = fit.lattice.at(450 + zero) - camera.phase - 450 * camera.period;
    sum.largest_phase_ms = std::max(sum.largest_phase_ms, std::abs(phase) / 1e6);
    for (std::size_t i = 0; i < camera.stamps.size(); ++i) {
      sum.outliers += fit.is_outlier(i) ? 1 : 0;
      sum.without_slot += fit.slots[i] == kNoSlot ? 1 : 0;
      sum.miscounted += fit.slots[i] != kNoSlot && fit.slots[i] - camera.index[i] != zero ? 1 : 0;
    }
    for (const PhaseStep& b : fit.phase_steps) {
      sum.own_breaks += b.group_step < 0 ? 1 : 0;
      if (b.group_step < 0) continue;
      ++sum.steps;
      EXPECT_EQ(camera.node, s.step_node);
      sum.step_ms = std::max(sum.step_ms, std::abs(b.step / 1e6 - s.step_ms));
      // A large step is located to one frame, a small one to two.
      std::size_t first = 0;
      while (static_cast<double>(camera.exposed[first]) < s.step_at_s * 1e9) ++first;
      EXPECT_LE(std::abs(static_cast<double>(first) - static_cast<double>(b.first_frame)),
                std::abs(s.step_ms) > 3 * s.jitter_ms ? 1 : 2);
    }
  }
}

TEST(ClockFit, GaussianJitterReachesTheCramerRaoBound) {
  Errors errors;
  constexpr int kSeeds = 8;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) add_errors({.seed = seed}, errors);
  std::printf("Gaussian: period rms %.2f ppm, bound %.2f ppm, largest %.1f ppm, phase %.2f ms\n",
              errors.rms_ppm(), errors.bound_ppm(), errors.largest_ppm, errors.largest_phase_ms);
  EXPECT_EQ(errors.method, ClockFitMethod::kLeastSquares);
  EXPECT_GT(errors.bound_ppm(), 9);  // 2 ppm cannot be reached
  EXPECT_LE(errors.rms_ppm(), 1.1 * errors.bound_ppm());
  EXPECT_LT(errors.largest_phase_ms, 1);
  EXPECT_EQ(errors.steps, 16 * kSeeds);
  EXPECT_EQ(errors.own_breaks, 0);
  EXPECT_LT(errors.step_ms, 0.5);
  EXPECT_EQ(errors.miscounted, 0);
  EXPECT_EQ(errors.without_slot, 0);
}

TEST(ClockFit, DelaysGivePeriodsWithinTwoPpm) {
  constexpr int kSeeds = 8;
  Errors all;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    add_errors({.seed = seed, .jitter = Jitter::kDelay}, all);
    EXPECT_EQ(all.method, ClockFitMethod::kEnvelope);
  }
  std::printf(
      "delays: period rms %.2f ppm, largest %.2f ppm, %d of %d within 2 ppm, phase %.3f ms, "
      "step %.3f ms, %d outliers\n",
      all.rms_ppm(), all.largest_ppm, all.within_two_ppm, all.cameras, all.largest_phase_ms,
      all.step_ms, all.outliers);
  // The estimator has the least mean squared error; errors above 2 ppm are chance.
  EXPECT_LT(all.rms_ppm(), 0.7);
  EXPECT_LT(all.largest_ppm, 3);
  EXPECT_GE(all.within_two_ppm, 0.99 * all.cameras);
  EXPECT_LT(all.largest_phase_ms, 0.1);
  EXPECT_EQ(all.steps, 16 * kSeeds);
  EXPECT_EQ(all.own_breaks, 0);
  EXPECT_LT(all.step_ms, 0.05);
  EXPECT_EQ(all.miscounted, 0);
  EXPECT_LE(all.outliers, 20 * kSeeds);  // later by more than nine times the mean delay
}

TEST(ClockFit, EightMinutesGiveTwoPpmWithGaussianJitter) {
  Errors errors;
  add_errors({.seed = 5, .seconds = 480, .step_node = -1}, errors);
  std::printf("Gaussian, 8 minutes: rms %.2f, largest %.2f ppm\n", errors.rms_ppm(),
              errors.largest_ppm);
  EXPECT_LT(errors.largest_ppm, 2);
  EXPECT_EQ(errors.miscounted, 0);
}

TEST(ClockFit, CamerasThatShareADriftShareTheEvidence) {
  // Equal camera crystals and drifting node clocks: 4 true periods, not 64.
  Errors shared, alone;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const Options s{.seed = seed, .crystal_ppm = 0, .node_ppm = 50};
    add_errors(s, shared);
    add_errors(s, alone, {.choose_method = true, .share_periods = false});
  }
  std::printf("shared drift: rms %.2f ppm together, %.2f ppm alone\n", shared.rms_ppm(),
              alone.rms_ppm());
  EXPECT_LT(shared.rms_ppm(), 0.5 * alone.rms_ppm());
}

TEST(ClockFit, StepsOfAnySizeAreFoundWithTheirWholePeriods) {
  for (const double step_ms :
       {-120.0, -60.0, -40.0, -15.0, -5.0, 5.0, 25.0, 33.3, 60.0, 90.0, 150.0, 700.0}) {
    // Time stamps of an archive increase, so a clock that steps back has a pause before.
    Options s{.seed = 9, .seconds = 40, .step_ms = step_ms, .step_at_s = 20};
    s.jitter_ms = 2;
    const SimulatedStamps truth(s);
    if (step_ms < -60) continue;
    Errors errors;
    add_errors(s, errors);
    EXPECT_EQ(errors.steps, 16) << step_ms;
    EXPECT_LT(errors.step_ms, 0.3) << step_ms;
    EXPECT_EQ(errors.miscounted, 0) << step_ms;
  }
}

TEST(ClockFit, NoStepWhereThereIsNone) {
  for (unsigned seed = 20; seed < 26; ++seed) {
    for (const Jitter jitter : {Jitter::kGaussian, Jitter::kDelay}) {
      const SimulatedStamps truth({.seed = seed, .step_node = -1, .jitter = jitter});
      for (const ClockFit& fit : fits_of(truth).cameras) EXPECT_TRUE(fit.phase_steps.empty());
    }
  }
}

TEST(ClockFit, ACameraThatRestartsJumpsAlone) {
  SimulatedStamps truth({.seed = 3, .jitter_ms = 1, .step_node = -1});
  auto& camera = truth.cameras[5];
  for (std::size_t i = 400; i < camera.stamps.size(); ++i) camera.stamps[i] += 20'000'000;
  const ClockFits fits = fits_of(truth);
  for (std::size_t c = 0; c < fits.cameras.size(); ++c) {
    ASSERT_EQ(fits.cameras[c].phase_steps.size(), c == 5 ? 1u : 0u) << c;
  }
  const PhaseStep& jump = fits.cameras[5].phase_steps[0];
  EXPECT_EQ(jump.group_step, -1);
  EXPECT_EQ(jump.first_frame, 400u);
  EXPECT_NEAR(jump.step, 20e6, 0.3e6);
}

// A recorder that was suspended receives the frames of that time at once.
TEST(ClockFit, AHeapOfFramesIsNoRhythm) {
  const auto is_regular = [](int before, int in_heap, int after) {
    std::vector<double> times;
    double time = 0;
    for (int i = 0; i < before; ++i, time += 33.3e6) times.push_back(time);
    time += 200e6;
    for (int i = 0; i < in_heap; ++i, time += 40e3) times.push_back(time + (i % 3) * 3e3);
    time += 15.1e6;
    for (int i = 0; i < after; ++i, time += 33.3e6) times.push_back(time);
    return fit_clocks({times}, {0}).cameras[0].regular;
  };
  for (const auto& [before, in_heap, after] :
       {std::array{0, 20, 0}, {0, 5, 1}, {3, 9, 3}, {5, 19, 4}, {1, 12, 2}, {5, 8, 0}}) {
    EXPECT_FALSE(is_regular(before, in_heap, after)) << before << " " << in_heap << " " << after;
  }
  EXPECT_TRUE(is_regular(20, 1, 20));
}

// A cable that was unplugged for most of a take does not change a camera's rate.
TEST(ClockFit, ALongGapLeavesTheRhythm) {
  std::vector<double> times;
  for (int i = 0; i < 900; ++i) {
    if (i < 40 || i > 860) times.push_back(i * 33.3e6 + (i % 5) * 1e4);
  }
  const ClockFit fit = fit_clocks({times}, {0}).cameras[0];
  EXPECT_TRUE(fit.regular);
  EXPECT_NEAR(fit.lattice.period, 33.3e6, 1e3);
}

// Testing every second period of a gap would take years.
TEST(ClockFit, AGapMayHaveAnyLength) {
  const auto steps_with = [](double gap) {
    std::vector<std::vector<double>> times(2);
    for (std::size_t c = 0; c < times.size(); ++c) {
      for (int i = 0; i < 240; ++i) {
        const double step = i < 160 ? 0 : 13e6;  // in the middle of the frames after the gap
        times[c].push_back(i * 33.3e6 + static_cast<double>(c) * 5e6 + (i % 3) * 1e4 + step +
                           (i < 80 ? 0 : gap));
      }
    }
    const std::vector<double> periods(2, 33.3e6);
    std::vector<std::size_t> frames;
    for (const DetectedPhaseStep& step : find_phase_steps(times, periods, {7, 0.02})) {
      EXPECT_NEAR(step.step, 13e6, 1e5) << gap;
      frames.insert(frames.end(), step.first_frame.begin(), step.first_frame.end());
    }
    return frames;
  };
  for (const double periods : {0.0, 90.0, 100.0, 1900.0, 2100.0, 1e6, 1e8}) {
    EXPECT_EQ(steps_with(periods * 33.3e6), (std::vector<std::size_t>{160, 160})) << periods;
  }
  // 104 days after frames that are one nanosecond apart, and where a double rounds to 16 ns.
  for (const double late : {8.9856e15, 1e17}) {
    EXPECT_FALSE(fit_clocks({{0, 1, 2, late}}, {0}).cameras[0].regular) << late;
    std::vector<double> times;
    for (const double begin : {0.0, late}) {
      for (int i = 0; i < 40; ++i) times.push_back(begin + i);
    }
    const double period = 1;
    EXPECT_TRUE(find_phase_steps({{times}}, {&period, 1}, {9, 0.1}).empty()) << late;
  }
}

TEST(CountFrames, LateFramesMoveBackExtraOnesHaveNoSlot) {
  const Lattice lattice{0, 100};
  const ResidualQuantiles even{-0.05, 0, 0.05};
  const auto slots = [&](std::vector<double> times) { return assign_slots(times, lattice, even); };
  using Slots = std::vector<std::int64_t>;
  EXPECT_EQ(slots({0, 101, 299, 400}), (Slots{0, 1, 3, 4}));
  EXPECT_EQ(slots({0, 160, 200, 300}), (Slots{0, 1, 2, 3}));  // the second arrived late
  EXPECT_EQ(slots({0, 100, 270, 370, 400}), (Slots{0, 1, 2, 3, 4}));
  EXPECT_EQ(slots({0, 100, 130, 200}), (Slots{0, 1, kNoSlot, 2}));  // one more frame than slots
  EXPECT_EQ(slots({-100, 0, 70, 100, 200}), (Slots{-1, 0, kNoSlot, 1, 2}));
}

TEST(CoarsePeriod, Extremes) {
  EXPECT_EQ(estimate_period({}), 0);
  EXPECT_EQ(estimate_period(std::vector<double>{5}), 0);
  EXPECT_EQ(estimate_period(std::vector<double>{5, 5, 5}), 0);
  EXPECT_EQ(estimate_period(std::vector<double>{0, 10, 20, 40}), 10);
}

}  // namespace
}  // namespace raystage::store
