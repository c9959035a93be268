// SPDX-License-Identifier: Apache-2.0
#include "calibrate/color/scene_color.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/error.h"
#include "rig/photometric_model.h"

namespace raystage::calibrate::scene_color_test {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr rig::PictureSize kPicture{640, 480};

/// Returns cameras in a row, each with its own contrast, brightness and vignetting.
schemas::RigDocument row_of(int cameras) {
  schemas::RigDocument document;
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> some(-1, 1);
  for (int i = 0; i < cameras; ++i) {
    schemas::RigDocument::Camera camera;
    camera.geometry.id = "c" + std::to_string(i);
    camera.geometry.width = kPicture.width;
    camera.geometry.height = kPicture.height;
    camera.geometry.intrinsics = {500, 500, 320, 240, {}};
    camera.geometry.world_from_camera[3] = 0.06 * i;
    for (std::size_t k = 0; k < 3; ++k) {
      camera.photometric.contrast[k] = 1 / (1 + 0.2 * some(random));
      camera.photometric.brightness[k] = -0.015 - 0.015 * some(random);
    }
    camera.photometric.vignetting = schemas::Vignetting{310, 250, {0.2, 0.05 * i, 0}};
    camera.photometric.matrix[0] = {1.1, -0.1, 0};
    document.cameras.push_back(camera);
  }
  return document;
}

/// Returns observations of points that three neighbouring cameras share. The share `wrong` of the
/// observations is of another point.
std::vector<ScenePatch> points_before(const schemas::RigDocument& truth, double wrong, double noise,
                                      double darkest = 0.02, double brightest = 0.6) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> part(0, 1);
  std::normal_distribution<double> normal(0, noise);
  std::vector<ScenePatch> points;
  const auto cameras = static_cast<int>(truth.cameras.size());
  for (int i = 0; i < 600 * cameras; ++i) {
    const auto some_light = [&] {
      return schemas::Rgb{std::lerp(darkest, brightest, part(random)),
                          std::lerp(darkest, brightest, part(random)),
                          std::lerp(darkest, brightest, part(random))};
    };
    const schemas::Rgb light = some_light();
    ScenePatch point;
    const int first = i % std::max(1, cameras - 2);
    for (int c = first; c < std::min(cameras, first + 3); ++c) {
      const int x = static_cast<int>(640 * part(random)), y = static_cast<int>(480 * part(random));
      const bool is_wrong = part(random) < wrong;
      schemas::Rgb measured = rig::invert_photometric_correction(
          truth.cameras[c].photometric, kPicture, x, y, is_wrong ? some_light() : light);
      for (double& channel : measured) channel *= 1 + normal(random);
      point.observations.push_back({c, x + 0.5, y + 0.5, measured});
    }
    points.push_back(point);
  }
  return points;
}

/// Returns the true rig without contrast and brightness, except those of the reference camera.
rig::Rig unmatched(schemas::RigDocument document, std::size_t reference = 0) {
  for (std::size_t i = 0; i < document.cameras.size(); ++i) {
    if (i == reference) continue;
    document.cameras[i].photometric.contrast = {1, 1, 1};
    document.cameras[i].photometric.brightness = {0, 0, 0};
  }
  return rig::rig_from_document(document);
}

double worst_light_error(const SceneColorMatch& found, const schemas::RigDocument& truth) {
  double worst = 0;
  for (std::size_t c = 0; c < truth.cameras.size(); ++c) {
    for (const double level : {0.1, 0.5}) {
      const schemas::Rgb measured = rig::invert_photometric_correction(
          truth.cameras[c].photometric, kPicture, 100, 100, {level, level, level});
      for (const double light :
           rig::apply_photometric_correction(found.responses[c], kPicture, 100, 100, measured)) {
        worst = std::max(worst, std::abs(light / level - 1));
      }
    }
  }
  return worst;
}

TEST(SceneColor, FindsContrastAndBrightnessExactly) {
  const schemas::RigDocument truth = row_of(5);
  const SceneColorMatch found =
      match_scene_colors(points_before(truth, 0, 0), unmatched(truth), 0, {});
  EXPECT_THAT(found.reasons, IsEmpty());
  EXPECT_LT(worst_light_error(found, truth), 1e-3);
  EXPECT_GT(found.before.mean_difference, 2.5);
  EXPECT_LT(found.after.mean_difference, 0.05);
  EXPECT_EQ(found.responses[0], truth.cameras[0].photometric);
  EXPECT_EQ(found.responses[3].vignetting, truth.cameras[3].photometric.vignetting);
}

TEST(SceneColor, GhostsAndNoiseAreLeftOut) {
  const schemas::RigDocument truth = row_of(5);
  const SceneColorMatch found =
      match_scene_colors(points_before(truth, 0.1, 0.02), unmatched(truth, 2), 2, {});
  EXPECT_THAT(found.reasons, IsEmpty());
  int observations = 0, inliers = 0;
  for (const ColorFit& fit : found.fits) {
    observations += fit.observations;
    inliers += fit.inliers;
  }
  EXPECT_LT(inliers, 0.95 * observations);
  EXPECT_GT(inliers, 0.7 * observations);
  EXPECT_LT(worst_light_error(found, truth), 0.01);
}

TEST(SceneColor, TwoCamerasAreEnough) {
  const schemas::RigDocument truth = row_of(2);
  const SceneColorMatch found =
      match_scene_colors(points_before(truth, 0.1, 0.01), unmatched(truth), 0, {});
  EXPECT_THAT(found.reasons, IsEmpty());
  EXPECT_LT(worst_light_error(found, truth), 0.01);
}

TEST(SceneColor, RefusesCamerasThatNothingJoins) {
  const schemas::RigDocument truth = row_of(6);
  std::vector<ScenePatch> points = points_before(truth, 0, 0.01);
  std::erase_if(points, [](const ScenePatch& point) {
    return point.observations.front().camera < 3 && point.observations.back().camera >= 3;
  });
  const SceneColorMatch found = match_scene_colors(points, unmatched(truth), 0, {});
  EXPECT_THAT(found.reasons,
              Contains(HasSubstr("No common points connect the reference camera to c3, c4")));
}

TEST(SceneColor, RefusesAnEmptySceneAndOneWithoutSense) {
  const schemas::RigDocument truth = row_of(3);
  const SceneColorMatch empty = match_scene_colors({}, unmatched(truth), 0, {});
  EXPECT_THAT(empty.reasons, Contains(HasSubstr("c0, c1, c2")));
  const SceneColorMatch senseless =
      match_scene_colors(points_before(truth, 0.9, 0), unmatched(truth), 0, {});
  EXPECT_THAT(senseless.reasons, Contains(HasSubstr("do not agree")));
}

TEST(SceneColor, IsGivenUpWhenAskedTo) {
  const schemas::RigDocument truth = row_of(3);
  std::stop_source source;
  source.request_stop();
  EXPECT_THROW(
      match_scene_colors(points_before(truth, 0, 0), unmatched(truth), 0, source.get_token()),
      Error);
}

TEST(SceneColor, OneCameraHasNobodyToAgreeWith) {
  const SceneColorMatch found = match_scene_colors({}, unmatched(row_of(1)), 0, {});
  EXPECT_THAT(found.reasons, Contains(HasSubstr("seen together with other cameras by c0")));
  EXPECT_EQ(found.responses[0], row_of(1).cameras[0].photometric);
}

TEST(SceneColor, TheSamePlaceTwiceIsNoNews) {
  // Duplicated points reduce the uncertainty at most by their number.
  const schemas::RigDocument truth = row_of(3);
  const std::vector<ScenePatch> once = points_before(truth, 0.05, 0.02);
  std::vector<ScenePatch> twice;
  for (const ScenePatch& point : once) twice.insert(twice.end(), {point, point});
  const SceneColorMatch one = match_scene_colors(once, unmatched(truth), 0, {});
  const SceneColorMatch two = match_scene_colors(twice, unmatched(truth), 0, {});
  EXPECT_LT(worst_light_error(two, truth), 0.01);
  for (std::size_t c = 1; c < 3; ++c) {
    EXPECT_GE(two.fits[c].uncertainty, 0.6 * one.fits[c].uncertainty);
  }
}

TEST(SceneColor, ASceneOfOneBrightnessIsNotBelievedAboutOthers) {
  schemas::RigDocument truth = row_of(4);
  // Without vignetting, which would turn one brightness into several.
  for (schemas::RigDocument::Camera& camera : truth.cameras) camera.photometric.vignetting.reset();
  for (const double noise : {0.0003, 0.001, 0.003, 0.01, 0.05}) {
    const SceneColorMatch found =
        match_scene_colors(points_before(truth, 0.02, noise, 0.3, 0.302), unmatched(truth), 0, {});
    EXPECT_THAT(found.reasons, Contains(HasSubstr("light is uncertain"))) << noise;
  }
}

TEST(SceneColor, SaysHowSureItIs) {
  const schemas::RigDocument truth = row_of(4);
  for (const double noise : {0.003, 0.01, 0.05}) {
    for (const double brightest : {0.35, 0.45, 0.6}) {
      const SceneColorMatch found = match_scene_colors(
          points_before(truth, 0.02, noise, 0.25, brightest), unmatched(truth), 0, {});
      double told = 0;
      for (const ColorFit& fit : found.fits) told = std::max(told, fit.uncertainty);
      EXPECT_LE(worst_light_error(found, truth), 1.5 * told) << noise << " " << brightest;
      EXPECT_LE(told, 40 * noise) << "or it would tell nothing";
    }
  }
}

}  // namespace
}  // namespace raystage::calibrate::scene_color_test
