// SPDX-License-Identifier: Apache-2.0
#include "store/processing/sync/flash.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "base/error.h"
#include "store/jpeg/encode.h"
#include "store/processing/sync/luminance.h"
#include "store/processing/sync/resync.h"
#include "testing/store/take_test_data.h"
#include "testing/test_folder.h"

namespace raystage::store {
namespace {

constexpr Nanoseconds kMs = 1'000'000;
constexpr double kPeriod = 1e9 / 15;

RgbImage grey(int width, int height, double level, std::mt19937& random) {
  RgbImage image{width, height, std::vector<std::uint8_t>()};
  std::normal_distribution<double> noise(0, 3);
  for (int i = 0; i < width * height; ++i) {
    const auto code = static_cast<std::uint8_t>(std::clamp(level + noise(random), 0.0, 255.0));
    for (int c = 0; c < 3; ++c) image.values.push_back(code);
  }
  return image;
}

// Free-running cameras of a few nodes with wrong clocks, and flashes of 100 ms. The shutters of the
// first node are global.
struct FlashTake {
  std::vector<Nanoseconds> offsets;
  std::vector<std::string> node;
  std::vector<CameraTimestamps> cameras;
  std::vector<std::vector<double>> brightness;

  FlashTake(unsigned seed, int nodes, int cameras_per_node, const std::vector<double>& flashes_s,
            double exposure_share, double drop = 0.03, double read_out_ms = 0) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform;
    std::normal_distribution<double> normal;
    for (int n = 0; n < nodes; ++n) {
      offsets.push_back(std::llround((2 * uniform(random) - 1) * 200e6));
      for (int c = 0; c < cameras_per_node; ++c) {
        CameraTimestamps camera{
            "c" + std::to_string(cameras.size()), "node" + std::to_string(n), {}, {}};
        std::vector<double> levels;
        const double phase = 1e9 + uniform(random) * kPeriod;
        const double base = 40 + 60 * uniform(random), gain = 30 + 80 * uniform(random);
        for (int i = 0; i < 120; ++i) {
          const double end = phase + i * kPeriod, begin = end - exposure_share * kPeriod;
          double lit = 0;
          const double own_read_out_ms = n > 0 ? read_out_ms : 0;
          const int rows = own_read_out_ms > 0 ? 50 : 1;
          for (const double flash : flashes_s) {
            for (int row = 0; row < rows; ++row) {
              const double later = 1e6 * own_read_out_ms * ((row + 0.5) / rows - 0.5);
              const double from = std::max(begin + later, flash * 1e9);
              lit += std::max(0.0, std::min(end + later, (flash + 0.1) * 1e9) - from) / rows;
            }
          }
          if (uniform(random) < drop) continue;
          camera.stamps.push_back(std::llround(end + 0.2e6 * normal(random)) + offsets.back());
          levels.push_back(base + gain * lit / (end - begin) + 0.3 * normal(random));
        }
        node.push_back(camera.node);
        cameras.push_back(std::move(camera));
        brightness.push_back(std::move(levels));
      }
    }
  }

  FlashOffsets recover(const std::vector<std::vector<double>>& luminance, bool per_camera,
                       Nanoseconds read_out = 0) const {
    const ResyncResult resync = resynchronise(cameras, {}, "test");
    std::vector<std::vector<FlashOnset>> jumps;
    std::vector<std::string> group;
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      jumps.push_back(
          find_flash_onsets(resync.times[c], luminance[c], node[c] == "node0" ? 0 : read_out));
      group.push_back(per_camera ? cameras[c].id : node[c]);
    }
    return offsets_from_flashes(jumps, group, "test");
  }
};

struct FlashErrors {
  double mean = 0, largest = 0, mean_stated = 0, largest_stated = 0;  // ms
};

FlashErrors node_errors(const std::vector<double>& flashes) {
  FlashErrors errors;
  constexpr unsigned kSeeds = 12;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    const FlashTake take(seed, 4, 16, flashes, seed % 2 == 0 ? 0.9 : 0.3);
    const FlashOffsets found = take.recover(take.brightness, false);
    EXPECT_EQ(found.groups.size(), 4u);
    EXPECT_EQ(found.flashes.size(), flashes.size());
    for (std::size_t n = 1; n < found.groups.size(); ++n) {
      const FlashOffset& group = found.groups[n];
      const double error =
          std::abs(static_cast<double>(group.offset - (take.offsets[n] - take.offsets[0])) / 1e6);
      const double stated = static_cast<double>(group.uncertainty.value_or(0)) / 1e6;
      // Jitter of 0.2 ms moves both ends of an interval.
      EXPECT_LE(error, stated + 0.3);
      errors.mean += error / (3 * kSeeds);
      errors.mean_stated += stated / (3 * kSeeds);
      errors.largest = std::max(errors.largest, error);
      errors.largest_stated = std::max(errors.largest_stated, stated);
    }
  }
  std::printf(
      "%zu flashes, 16 cameras a node: error mean %.2f, largest %.2f ms; stated mean %.2f, "
      "largest %.2f ms\n",
      flashes.size(), errors.mean, errors.largest, errors.mean_stated, errors.largest_stated);
  return errors;
}

TEST(Flash, NodeOffsetsWithinTheirStatedUncertainty) {
  const FlashErrors one = node_errors({4.2});
  EXPECT_LT(one.mean, 5);
  EXPECT_LT(one.largest_stated, 22);  // a third of a frame time
  const FlashErrors three = node_errors({2.91, 4.95, 6.973});
  EXPECT_LT(three.mean, one.mean);
  EXPECT_LT(three.mean_stated, 0.8 * one.mean_stated);
}

TEST(Flash, PerCameraWithinAFrameTimeAndBetterWithMoreFlashes) {
  double one = 0, five = 0;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    for (const int flashes : {1, 5}) {
      std::vector<double> times{2.61};
      if (flashes == 5) times = {2.61, 4.033, 5.487, 6.93, 8.391};
      const FlashTake take(seed, 2, 8, times, 0.5, 0);
      const FlashOffsets found = take.recover(take.brightness, true);
      for (std::size_t c = 0; c < take.cameras.size(); ++c) {
        const Nanoseconds truth = take.offsets[c / 8] - take.offsets[0];
        ASSERT_TRUE(found.groups[c].uncertainty);
        const double error = std::abs(static_cast<double>(found.groups[c].offset - truth));
        EXPECT_LE(error, static_cast<double>(*found.groups[c].uncertainty) + 0.3e6);
        double& sum = flashes == 1 ? one : five;
        sum += error / 1e6 / (6 * 16);
      }
    }
  }
  std::printf("flash per camera: mean error %.1f ms with one, %.1f ms with five\n", one, five);
  EXPECT_LT(one, 35);
}

// Returns by how much offsets are beyond what is stated, at most, ms: of nodes of three cameras,
// whose read-out takes 60 ms except in the first node.
double beyond_stated_ms(Nanoseconds stated_read_out) {
  double beyond = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const FlashTake take(seed, 4, 3, {2.91, 4.95, 6.973}, 0.3, 0, 60);
    const FlashOffsets found = take.recover(take.brightness, false, stated_read_out);
    for (std::size_t n = 1; n < found.groups.size(); ++n) {
      if (!found.groups[n].uncertainty) continue;
      const Nanoseconds error =
          std::abs(found.groups[n].offset - (take.offsets[n] - take.offsets[0]));
      beyond = std::max(beyond, static_cast<double>(error - *found.groups[n].uncertainty) / 1e6);
    }
  }
  return beyond;
}

TEST(Flash, MayBeginWithAnyRowOfARollingShutter) {
  EXPECT_LE(beyond_stated_ms(60 * kMs), 0.3);
  EXPECT_GT(beyond_stated_ms(0), 1);  // as if the shutters were global
}

TEST(Flash, FromPicturesOfATake) {
  const FlashTake truth(3, 2, 6, {4.2}, 0.8);
  const testing::TestFolder folder;
  schemas::TakeDocument document = testing::take_document(12);
  for (std::size_t c = 0; c < 12; ++c) document.cameras[c].node = truth.node[c];
  TakeWriter writer(folder.path() / "take", document, testing::rig_document(12));
  std::mt19937 random(1);
  for (int c = 0; c < 12; ++c) {
    const CameraTimestamps& camera = truth.cameras[c];
    for (std::size_t i = 0; i < camera.stamps.size(); ++i) {
      const double level = truth.brightness[c][i];
      writer.archive(c).append(encode_jpeg(grey(48, 40, level, random), {.quality = 80}),
                               camera.stamps[i]);
    }
  }
  writer.commit();
  const Take take(folder.path() / "take");
  const ResyncResult resync = resynchronise(camera_timestamps(take), {}, "test");
  const auto luminance =
      measure_luminance(take, resync.times, 2'000 * kMs, 7'000 * kMs, [](double) {}, {});
  for (std::size_t c = 0; c < 12; ++c) {
    for (std::size_t i = 0; i < luminance[c].size(); ++i) {
      const bool inside = resync.times[c][i] >= 2'000 * kMs && resync.times[c][i] <= 7'000 * kMs;
      ASSERT_EQ(std::isfinite(luminance[c][i]), inside);
      if (!inside) continue;
      EXPECT_NEAR(luminance[c][i], truth.brightness[c][i], 1.5);
    }
  }
  const FlashOffsets found = truth.recover(luminance, false);
  EXPECT_LE(std::abs(found.groups[1].offset - (truth.offsets[1] - truth.offsets[0])),
            *found.groups[1].uncertainty + kMs / 2);
}

TEST(Flash, WithoutAFlashThereIsNothingToSay) {
  const FlashTake take(1, 2, 4, {}, 0.5);
  try {
    take.recover(take.brightness, false);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
  }
}

TEST(Flash, OnlyASuddenRiseIsAJump) {
  std::vector<Nanoseconds> times;
  std::vector<double> luminance;
  for (int i = 0; i < 60; ++i) {
    times.push_back(i * 100 * kMs);
    luminance.push_back(50 + 0.5 * i + (i % 2));  // daylight increases slowly
  }
  EXPECT_TRUE(find_flash_onsets(times, luminance).empty());
  luminance[30] += 90;
  luminance[31] += 40;
  const auto jumps = find_flash_onsets(times, luminance);
  ASSERT_EQ(jumps.size(), 1u);
  EXPECT_EQ(jumps[0].until, 3'000 * kMs);
  EXPECT_LE(jumps[0].after, 2'900 * kMs);
  EXPECT_GT(jumps[0].after, 2'850 * kMs);
  EXPECT_NEAR(jumps[0].strength, 91, 2);
  EXPECT_TRUE(find_flash_onsets({}, {}).empty());
}

TEST(MeanLuminance, DamagedFramesHaveNone) {
  EXPECT_TRUE(std::isnan(mean_luminance({})));
  std::mt19937 random(1);
  const auto jpeg = encode_jpeg(grey(33, 17, 100, random), {.quality = 90});
  EXPECT_NEAR(mean_luminance(jpeg), 100, 1);
  EXPECT_TRUE(std::isnan(mean_luminance(std::span(jpeg).first(40))));
}

}  // namespace
}  // namespace raystage::store
