// SPDX-License-Identifier: Apache-2.0
// Tests of the envelope against slow, simple references.
#include "store/processing/sync/envelope.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace raystage::store {
namespace {

struct Stamps {
  std::vector<double> slots, times;
};

Stamps delayed(unsigned seed, int count) {
  std::mt19937 random(seed);
  std::exponential_distribution<double> delay(1 / 5e6);
  Stamps stamps;
  for (int i = 0; i < count; ++i) {
    if (random() % 10 == 0) continue;
    stamps.slots.push_back(i);
    stamps.times.push_back(3e8 + i * 66'666'667.0 + delay(random));
  }
  return stamps;
}

double sum_over(const Stamps& stamps, const Lattice& line) {
  double sum = 0;
  for (std::size_t i = 0; i < stamps.slots.size(); ++i) {
    sum += stamps.times[i] - line.origin - line.period * stamps.slots[i];
  }
  return sum;
}

double lowest_under(const Stamps& stamps, double period) {
  double lowest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < stamps.slots.size(); ++i) {
    lowest = std::min(lowest, stamps.times[i] - period * stamps.slots[i]);
  }
  return lowest;
}

TEST(LowerEnvelope, IsTheBestOfAllLinesThroughTwoFrames) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Stamps stamps = delayed(seed, 60);
    double best = std::numeric_limits<double>::infinity();
    for (std::size_t a = 0; a < stamps.slots.size(); ++a) {
      for (std::size_t b = a + 1; b < stamps.slots.size(); ++b) {
        const double period =
            (stamps.times[b] - stamps.times[a]) / (stamps.slots[b] - stamps.slots[a]);
        // The highest line of this slope below all frames.
        best = std::min(best, sum_over(stamps, {lowest_under(stamps, period), period}));
      }
    }
    const Envelope found = lower_envelope(stamps.slots, stamps.times, false);
    EXPECT_NEAR(found.sum, best, 1);
    EXPECT_NEAR(sum_over(stamps, found.line), best, 1);
    EXPECT_GE(lowest_under(stamps, found.line.period), found.line.origin - 1e-3);
  }
}

TEST(LowerEnvelope, PosteriorMeanIsThatOfASum) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const Stamps stamps = delayed(seed, 80);
    const auto count = static_cast<double>(stamps.slots.size());
    const Envelope edge = lower_envelope(stamps.slots, stamps.times, false);
    const Envelope mean = lower_envelope(stamps.slots, stamps.times, true);
    const double rate = count * (count - 2) / edge.sum;  // frames per mean delay
    double middle = 0;
    for (const double slot : stamps.slots) middle += slot / count;
    // Integrates over slopes, and for each slope over heights below the frames.
    double weight = 0, period = 0, height = 0;
    const double top = edge.line.origin + edge.line.period * middle;
    constexpr int kSteps = 40'000;
    for (int k = -kSteps; k <= kSteps; ++k) {
      const double p = edge.line.period + 400'000.0 * k / kSteps;
      const double highest = lowest_under(stamps, p) + p * middle;
      const double w = std::exp(rate * (highest - top));
      weight += w;
      period += w * (p - edge.line.period);
      height += w * (highest - 1 / rate - top);
    }
    EXPECT_NEAR(mean.line.period - edge.line.period, period / weight, 5) << seed;
    EXPECT_NEAR(mean.line.origin + mean.line.period * middle - top, height / weight, 100) << seed;
  }
}

TEST(LowerEnvelope, AVertexAtTheMeanSlotIsTheLimitOfVerticesBesideIt) {
  constexpr int kCount = 81, kMiddle = kCount / 2;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    std::mt19937 random(seed);
    std::exponential_distribution<double> delay(1 / 5e6);
    Stamps stamps;
    for (int i = 0; i < kCount; ++i) {
      stamps.slots.push_back(i);
      stamps.times.push_back(3e8 + i * 66'666'667.0 + (i == kMiddle ? 0 : delay(random)));
    }
    const Envelope at_mean = lower_envelope(stamps.slots, stamps.times, true);
    for (const double shift : {1e-3, -1e-3, 1e-6, -1e-6, 1e-9, -1e-9}) {
      Stamps moved = stamps;
      moved.slots[kMiddle] += shift;
      moved.times[kMiddle] += shift * 66'666'667.0;
      const Envelope beside = lower_envelope(moved.slots, moved.times, true);
      EXPECT_NEAR(at_mean.line.period, beside.line.period, 10) << seed << " " << shift;
      EXPECT_NEAR(at_mean.line.origin + at_mean.line.period * kMiddle,
                  beside.line.origin + beside.line.period * kMiddle, 100)
          << seed << " " << shift;
    }
  }
}

TEST(LowerEnvelope, PosteriorMeanErrsLess) {
  double edge = 0, mean = 0;
  for (unsigned seed = 1; seed <= 300; ++seed) {
    const Stamps stamps = delayed(seed, 200);
    const auto square = [](double x) { return x * x; };
    const auto error = [&](bool posterior_mean) {
      return lower_envelope(stamps.slots, stamps.times, posterior_mean).line.period - 66'666'667.0;
    };
    edge += square(error(false));
    mean += square(error(true));
  }
  EXPECT_LT(mean, 0.8 * edge);
}

TEST(LowerEnvelope, TwoFramesAndExactOnes) {
  const std::vector<double> slots{0, 3}, times{5, 35};
  const Envelope two = lower_envelope(slots, times, true);
  EXPECT_DOUBLE_EQ(two.line.period, 10);
  EXPECT_DOUBLE_EQ(two.line.origin, 5);
  std::vector<double> many, at;
  for (int i = 0; i < 50; ++i) {
    many.push_back(i);
    at.push_back(100.0 * i);
  }
  EXPECT_DOUBLE_EQ(lower_envelope(many, at, true).line.period, 100);
}

}  // namespace
}  // namespace raystage::store
