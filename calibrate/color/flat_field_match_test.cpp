// SPDX-License-Identifier: Apache-2.0
#include "calibrate/color/flat_field_match.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "base/error.h"
#include "calibrate/color/vignetting.h"

namespace raystage::calibrate::flat_field_match_test {
namespace {

using ::testing::HasSubstr;

constexpr rig::PictureSize kPicture{640, 480};

/// Returns the measurement by a camera of a target whose light is a function of the pixel position.
FlatFieldMeasurement measured_field(const schemas::PhotometricResponse& response,
                                    const std::function<double(double, double)>& light) {
  FlatFieldMeasurement measurement;
  measurement.size = kPicture;
  int in_middle = 0;
  for (int row = 0; row < 24; ++row) {
    for (int column = 0; column < 32; ++column) {
      FlatFieldCell cell{column * 20.0 + 10, row * 20.0 + 10, {}};
      const double here = light(cell.x, cell.y);
      cell.mean = rig::invert_photometric_correction(response, kPicture, static_cast<int>(cell.x),
                                                     static_cast<int>(cell.y), {here, here, here});
      measurement.cells.push_back(cell);
      if (row < 6 || row >= 18 || column < 8 || column >= 24) continue;
      for (std::size_t c = 0; c < 3; ++c) measurement.mean[c] += cell.mean[c];
      ++in_middle;
    }
  }
  for (double& mean : measurement.mean) mean /= in_middle;
  return measurement;
}

schemas::PhotometricResponse dim_lens() {
  schemas::PhotometricResponse response;
  response.contrast = {1.25, 0.9, 1.1};
  response.brightness = {-0.02, -0.01, -0.005};
  response.vignetting = schemas::Vignetting{330, 228, {0.3, 0.1, 0.02}};
  return response;
}

std::vector<FlatFieldMeasurements> targets_of(
    const std::vector<schemas::PhotometricResponse>& cameras) {
  std::vector<FlatFieldMeasurements> targets;
  for (const double level : {0.6, 0.15, 0.0}) {
    FlatFieldMeasurements& target = targets.emplace_back();
    for (const schemas::PhotometricResponse& camera : cameras) {
      target.push_back(measured_field(camera, [&](double, double) { return level; }));
    }
  }
  return targets;
}

TEST(FlatTarget, FindsContrastBlackAndVignettingTogether) {
  schemas::PhotometricResponse reference;
  reference.brightness = {-0.01, -0.02, -0.03};
  reference.vignetting = schemas::Vignetting{310, 250, {0.2, 0.05, 0}};
  FlatFieldMatchOptions options;
  options.vignetting = options.dark = true;
  const schemas::PhotometricResponse truth = dim_lens();
  const FlatFieldMatch found =
      match_flat_fields(targets_of({reference, truth}), {"a", "b"}, options);
  EXPECT_TRUE(found.reasons.empty());
  EXPECT_LT(found.worst_vignetting, 1e-3);
  for (const double level : {0.1, 0.5}) {
    for (const auto& [x, y] : {std::pair{0, 0}, {320, 240}, {639, 100}}) {
      const schemas::Rgb shown =
          rig::invert_photometric_correction(truth, kPicture, x, y, {level, level, level});
      const schemas::Rgb light =
          rig::apply_photometric_correction(found.responses[1], kPicture, x, y, shown);
      for (const double channel : light) EXPECT_NEAR(channel, level, 0.003 * level) << x;
    }
  }
  EXPECT_GT(found.before.mean_difference, 3);
  EXPECT_LT(found.after.mean_difference, 0.1);
}

TEST(FlatTarget, OneCameraIsItsOwnMeasure) {
  const FlatFieldMatch found = match_flat_fields(targets_of({dim_lens()}), {"a"}, {});
  EXPECT_TRUE(found.reasons.empty());
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(found.responses[0].contrast[c], 1, 1e-9);
    EXPECT_NEAR(found.responses[0].brightness[c], 0, 1e-9);
  }
}

TEST(FlatTarget, ADustSpotOnTheTargetDoesNotMoveTheLens) {
  const schemas::PhotometricResponse truth = dim_lens();
  const FlatFieldMeasurement measurement = measured_field(
      truth, [](double x, double y) { return std::hypot(x - 450, y - 300) < 45 ? 0.42 : 0.6; });
  const VignettingFit found = fit_vignetting(measurement.cells, kPicture, truth);
  schemas::PhotometricResponse measured = truth;
  measured.vignetting = found.lens;
  for (const auto& [x, y] : {std::pair{0.0, 0.0}, {320.0, 240.0}, {640.0, 480.0}}) {
    const double ratio =
        rig::gain_at(measured, kPicture, x, y)[1] / rig::gain_at(truth, kPicture, x, y)[1];
    EXPECT_NEAR(
        ratio,
        rig::gain_at(measured, kPicture, 320, 240)[1] / rig::gain_at(truth, kPicture, 320, 240)[1],
        0.01);
  }
}

/// Returns the transmission of a tinted filter in front of the lower half of a lens.
double through_filter(double, double y, std::size_t channel) {
  const double tint = 0.1 * static_cast<double>(channel) + 0.05;
  return 1 - tint / (1 + std::exp(-(y - 260) / 25));
}

TEST(FlatTarget, AGainMapEvensOutWhatNoLensExplains) {
  const schemas::PhotometricResponse lens = dim_lens();
  std::vector<FlatFieldMeasurements> targets = targets_of({{}, lens});
  for (FlatFieldMeasurements& target : targets) {
    for (FlatFieldCell& cell : target[1].cells) {
      for (std::size_t c = 0; c < 3; ++c) {
        const double black = -lens.brightness[c] / lens.contrast[c];
        cell.mean[c] = black + (cell.mean[c] - black) * through_filter(cell.x, cell.y, c);
      }
    }
    schemas::Rgb& mean = target[1].mean;
    mean = {};
    for (const FlatFieldCell& cell : target[1].cells) {
      if (std::abs(cell.x - 320) > 160 || std::abs(cell.y - 240) > 120) continue;
      for (std::size_t c = 0; c < 3; ++c) mean[c] += cell.mean[c] / (16 * 12);
    }
  }
  FlatFieldMatchOptions options;
  options.flat_field = true;
  for (const bool vignetting : {false, true}) {
    options.vignetting = vignetting;
    const FlatFieldMatch found = match_flat_fields(targets, {"a", "b"}, options);
    EXPECT_TRUE(found.reasons.empty());
    for (const double level : {0.1, 0.5}) {
      for (const auto& [x, y] : {std::pair{10, 10}, {320, 240}, {629, 100}, {200, 460}}) {
        schemas::Rgb lit{};
        for (std::size_t c = 0; c < 3; ++c) lit[c] = level * through_filter(x, y, c);
        const schemas::Rgb shown = rig::invert_photometric_correction(lens, kPicture, x, y, lit);
        const schemas::Rgb light =
            rig::apply_photometric_correction(found.responses[1], kPicture, x, y, shown);
        for (const double channel : light) EXPECT_NEAR(channel, level, 0.01 * level) << x << y;
      }
    }
  }
  targets[0][1].cells[7].mean = {0.001, 0.001, 0.001};
  EXPECT_THROW(match_flat_fields(targets, {"a", "b"}, options), Error);
}

TEST(FlatTarget, WhatNoLensCouldHaveDoneIsRefused) {
  std::vector<FlatFieldMeasurements> targets = targets_of({{}, {}});
  // The uneven light is in camera a: all cameras are checked, not only the last.
  targets[0][0] = measured_field({}, [](double x, double) { return x < 320 ? 0.6 : 0.45; });
  FlatFieldMatchOptions options;
  options.vignetting = true;
  const FlatFieldMatch uneven = match_flat_fields(targets, {"a", "b"}, options);
  ASSERT_FALSE(uneven.reasons.empty());
  EXPECT_THAT(uneven.reasons[0], HasSubstr("evenly lit"));

  targets = targets_of({{}, {}});
  targets[0][0].clipped = 0.5;
  options.vignetting = false;
  const FlatFieldMatch clipped = match_flat_fields(targets, {"a", "b"}, options);
  ASSERT_EQ(clipped.reasons.size(), 1U);
  EXPECT_THAT(clipped.reasons[0], HasSubstr("overexposed"));

  targets = targets_of({{}, {}});
  targets[2][1].hot_pixels.resize(schemas::PhotometricResponse::kMaxHotPixels + 1);
  options.dark = true;
  const FlatFieldMatch lit = match_flat_fields(targets, {"a", "b"}, options);
  ASSERT_EQ(lit.reasons.size(), 1U);
  EXPECT_THAT(lit.reasons[0], HasSubstr("cap the lenses"));

  targets.pop_back();  // the grey target is then the dark one
  const FlatFieldMatch grey = match_flat_fields(targets, {"a", "b"}, options);
  ASSERT_EQ(grey.reasons.size(), 1U);
  EXPECT_THAT(grey.reasons[0], HasSubstr("not dark"));
  targets = targets_of({{}, {}});
  targets[2][0].black = {0.5, 0.5, 0.5};
  const FlatFieldMatch cut_off = match_flat_fields(targets, {"a", "b"}, options);
  EXPECT_TRUE(cut_off.reasons.empty());
  ASSERT_FALSE(cut_off.warnings.empty());
  EXPECT_THAT(cut_off.warnings[0], HasSubstr("another reference camera"));
}

}  // namespace
}  // namespace raystage::calibrate::flat_field_match_test
