// SPDX-License-Identifier: Apache-2.0
// Tests colour calibration from targets and scenes by the commands that users run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/transfer_function.h"
#include "rig/photometric_model.h"
#include "schemas/rig_document.h"
#include "store/jpeg/decode.h"
#include "testing/test_folder.h"
#include "tests/end_to_end/run_command.h"
#include "tests/end_to_end/true_rig.h"

namespace raystage {
namespace {

using testing::CommandResult;
using ::testing::HasSubstr;
using testing::run;
using testing::write_true_rig;

TEST(CalibrateColor, TargetsMakeColoursAlike) {
  const testing::TestFolder folder;
  const auto take = [&](const std::string& target) { return (folder.path() / target).string(); };
  for (const char* target : {"white", "grey", "black"}) {
    ASSERT_EQ(run("raystage simulate " + std::string(target) + " -o " + take(target) +
                  " --rows 2 --columns 3 --seconds 1 --fps 6 --width 160 --height 120 "
                  "--truth-views 0 --startup-loss-seconds 0 --photometric 0.1 --noise 0.02 "
                  "--quality 98 --calibration "
                  "nominal -q")
                  .exit_code,
              0);
  }
  const std::string rig = (folder.path() / "rig.json").string();
  const CommandResult found = run("raystage calibrate color " + take("white") + " " + take("grey") +
                                  " " + take("black") + " -o " + rig);
  ASSERT_EQ(found.exit_code, 0) << found.out << found.err;
  // Truth: light = brightness + contrast * shown; here relative to the first camera.
  const schemas::RigDocument truth = schemas::read_rig(write_true_rig(take("white"))),
                             measured = schemas::read_rig(rig);
  const schemas::PhotometricResponse& first = truth.cameras[0].photometric;
  for (std::size_t i = 0; i < truth.cameras.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const schemas::PhotometricResponse &expected = truth.cameras[i].photometric,
                                         &response = measured.cameras[i].photometric;
      const double contrast = expected.contrast[k] / first.contrast[k];
      EXPECT_NEAR(response.contrast[k], contrast, 0.01 * contrast) << i;
    }
  }
  EXPECT_EQ(
      run("raystage calibrate color " + take("white") + " --reference nobody -o " + rig).exit_code,
      2);

  // Another frame size than the rig's; a target that is not flat.
  schemas::RigDocument larger = schemas::read_rig(rig);
  for (schemas::RigDocument::Camera& camera : larger.cameras) camera.geometry.width = 320;
  const std::string other = (folder.path() / "larger.json").string();
  schemas::write_rig(larger, other);
  const CommandResult size =
      run("raystage calibrate color " + take("white") + " --initial-rig " + other + " -o " + rig);
  EXPECT_EQ(size.exit_code, 2);
  EXPECT_THAT(size.err, HasSubstr("160x120"));
  const CommandResult dark = run("raystage calibrate color " + take("black") + " -o " + rig);
  EXPECT_NE(dark.exit_code, 0) << dark.out;

  // White balance: the slightly warm target becomes grey.
  ASSERT_EQ(run("raystage calibrate color " + take("white") + " " + take("grey") + " " +
                take("black") + " --neutral -o " + rig)
                .exit_code,
            0);
  const schemas::RigDocument neutral = schemas::read_rig(rig);
  for (std::size_t i = 0; i < truth.cameras.size(); ++i) {
    const schemas::Rgb shown = rig::invert_photometric_correction(
        truth.cameras[i].photometric, {160, 120}, 80, 60, {0.6, 0.96 * 0.6, 0.9 * 0.6});
    const schemas::Rgb light = rig::apply_photometric_correction(neutral.cameras[i].photometric,
                                                                 {160, 120}, 80, 60, shown);
    EXPECT_NEAR(light[0], light[1], 0.01 * light[1]) << i;
    EXPECT_NEAR(light[2], light[1], 0.01 * light[1]) << i;
  }
}

TEST(CalibrateColor, TargetsMendVignettingOffsetsAndHotPixels) {
  const testing::TestFolder folder;
  const auto take = [&](const std::string& target) { return (folder.path() / target).string(); };
  for (const char* target : {"white", "grey", "black"}) {
    ASSERT_EQ(run("raystage simulate " + std::string(target) + " -o " + take(target) +
                  " --rows 2 --columns 3 --seconds 1 --fps 12 --width 160 --height 120 "
                  "--truth-views 0 --startup-loss-seconds 0 --drop 0 --noise 0.02 --quality 98 "
                  "--gain 0.2 --white-balance 0.1 --offset 0.031 --vignetting 0.3 --hot-pixels 20 "
                  "--calibration nominal -q")
                  .exit_code,
              0);
  }
  const schemas::RigDocument truth = schemas::read_rig(write_true_rig(take("white")));
  // The reference is a camera with a black level above 0.
  std::size_t reference = 0;
  const auto shown_black = [&](std::size_t camera) {
    const schemas::PhotometricResponse& response = truth.cameras[camera].photometric;
    double least = 1;
    for (std::size_t k = 0; k < 3; ++k) {
      least = std::min(least, -response.brightness[k] / response.contrast[k]);
    }
    return least;
  };
  for (std::size_t i = 1; i < truth.cameras.size(); ++i) {
    if (shown_black(i) > shown_black(reference)) reference = i;
  }
  ASSERT_GT(shown_black(reference), 0);
  const std::string rig = (folder.path() / "rig.json").string();
  const std::string sheet = (folder.path() / "sheet.jpg").string();
  const CommandResult found =
      run("raystage calibrate color " + take("white") + " " + take("grey") + " --dark " +
          take("black") + " --vignetting --contact-sheet " + sheet + " --reference " +
          truth.cameras[reference].geometry.id + " -o " + rig);
  ASSERT_EQ(found.exit_code, 0) << found.out << found.err;
  // Two columns of three tiles, two rows: in the right column all tiles are equal.
  const std::string jpeg = testing::read_text(sheet);
  const store::RgbImage picture =
      store::JpegDecoder().decode(std::as_bytes(std::span(jpeg)), "sheet");
  const auto green = [&](int x, int y) {
    return int{picture.values[3 * static_cast<std::size_t>(y * picture.width + x) + 1]};
  };
  const int half = picture.width / 2;
  int least[2] = {255, 255}, most[2] = {0, 0};
  for (const int x : {20, 100, 240, 300, 400, 460}) {
    for (const int y : {10, 60, 100, 140, 200, 230}) {
      for (const int side : {0, 1}) {
        least[side] = std::min(least[side], green(x + side * half, y));
        most[side] = std::max(most[side], green(x + side * half, y));
      }
    }
  }
  EXPECT_GT(most[0] - least[0], 30);
  EXPECT_LT(most[1] - least[1], 12);
  const schemas::RigDocument measured = schemas::read_rig(rig);
  const schemas::Rgb& scale = truth.cameras[reference].photometric.contrast;
  const rig::PictureSize size{160, 120};
  const auto expect_light = [&](const schemas::RigDocument& by, double within) {
    for (std::size_t i = 0; i < truth.cameras.size(); ++i) {
      for (const auto& [x, y] : {std::pair{0, 0}, {159, 0}, {80, 60}, {20, 100}, {159, 119}}) {
        const schemas::Rgb shown = rig::invert_photometric_correction(truth.cameras[i].photometric,
                                                                      size, x, y, {0.5, 0.5, 0.5});
        const schemas::Rgb light =
            rig::apply_photometric_correction(by.cameras[i].photometric, size, x, y, shown);
        for (std::size_t k = 0; k < 3; ++k) {
          EXPECT_NEAR(light[k] * scale[k], 0.5, within * 0.5) << i << " at " << x << ", " << y;
        }
      }
    }
  };
  expect_light(measured, 0.01);
  const CommandResult mapped =
      run("raystage calibrate color " + take("white") + " " + take("grey") + " --dark " +
          take("black") + " --flat-field --reference " + truth.cameras[reference].geometry.id +
          " -o " + rig);
  ASSERT_EQ(mapped.exit_code, 0) << mapped.out << mapped.err;
  EXPECT_TRUE(schemas::read_rig(rig).cameras[1].photometric.gain_map);
  expect_light(schemas::read_rig(rig), 0.02);
  for (std::size_t i = 0; i < truth.cameras.size(); ++i) {
    const schemas::PhotometricResponse &expected = truth.cameras[i].photometric,
                                       &response = measured.cameras[i].photometric;
    // Every clearly hot pixel is found, with its light in the dark frame.
    for (const schemas::HotPixel& hot : expected.hot_pixels) {
      const auto same = std::ranges::find_if(
          response.hot_pixels,
          [&](const schemas::HotPixel& pixel) { return pixel.x == hot.x && pixel.y == hot.y; });
      if (hot.light[2] < 0.06) continue;  // an offset below 0 may hide it
      ASSERT_NE(same, response.hot_pixels.end()) << i << " at " << hot.x << ", " << hot.y;
      EXPECT_NEAR(same->light[1], hot.light[1], 0.04 + 0.05 * hot.light[1]);
    }
  }
}

TEST(CalibrateColor, ExposuresStraightenEveryCamerasCurve) {
  const testing::TestFolder folder;
  const auto take = [&](const std::string& target) { return (folder.path() / target).string(); };
  for (const char* target : {"white", "grey", "black"}) {
    ASSERT_EQ(run("raystage simulate " + std::string(target) + " -o " + take(target) +
                  " --rows 1 --columns 3 --seconds 1 --fps 12 --width 160 --height 120 "
                  "--truth-views 0 --startup-loss-seconds 0 --drop 0 --noise 0.02 --quality 98 "
                  "--gain 0.2 --offset 0.02 --vignetting 0.3 --curve 0.15 --calibration nominal -q")
                  .exit_code,
              0);
  }
  const std::string rig = (folder.path() / "rig.json").string();
  const std::string command = "raystage calibrate color " + take("white") + " " + take("grey") +
                              " --dark " + take("black") + " --vignetting -o " + rig;
  EXPECT_EQ(run(command + " --exposures 4").exit_code, 2) << "one exposure for two takes";
  const CommandResult swapped = run(command + " --exposures 1,4");
  EXPECT_EQ(swapped.exit_code, 2);
  EXPECT_THAT(swapped.err, HasSubstr("darker"));
  const CommandResult found = run(command + " --exposures 4,1");  // the ratio of their light
  ASSERT_EQ(found.exit_code, 0) << found.out << found.err;
  const schemas::RigDocument truth = schemas::read_rig(write_true_rig(take("white"))),
                             measured = schemas::read_rig(rig);
  const auto light_by = [](const schemas::PhotometricResponse& response, double code) {
    schemas::Rgb shown{};
    for (std::size_t k = 0; k < 3; ++k) {
      shown[k] = linear_from_srgb(rig::evaluate_response_curve(response.curve[k], code));
    }
    return rig::apply_photometric_correction(response, {160, 120}, 80, 60, shown);
  };
  const auto scale = [&](std::size_t k) {  // of the reference camera at white
    return light_by(measured.cameras[0].photometric, 0.75)[k] /
           light_by(truth.cameras[0].photometric, 0.75)[k];
  };
  for (std::size_t i = 0; i < truth.cameras.size(); ++i) {
    for (const double code : {0.45, 0.55, 0.65, 0.75}) {
      const schemas::Rgb expected = light_by(truth.cameras[i].photometric, code);
      const schemas::Rgb light = light_by(measured.cameras[i].photometric, code);
      for (std::size_t k = 0; k < 3; ++k) {
        EXPECT_NEAR(light[k], expected[k] * scale(k), 0.02 * expected[k]) << i << " at " << code;
      }
    }
  }
}

/// Writes the true rig of a take without its colour response, and returns the file.
std::string colourless_rig_of(const std::filesystem::path& take) {
  schemas::RigDocument rig = schemas::read_rig(write_true_rig(take));
  for (schemas::RigDocument::Camera& camera : rig.cameras) camera.photometric = {};
  const std::filesystem::path file = take / "colourless_rig.json";
  schemas::write_rig(rig, file);
  return file.string();
}

TEST(CalibrateColor, ASceneMakesColoursAlikeWithoutATarget) {
  const testing::TestFolder folder;
  const std::string take = (folder.path() / "stage").string();
  ASSERT_EQ(run("raystage simulate stage -o " + take +
                " --rows 2 --columns 3 --seconds 0.6 --fps 6 --width 320 --height 240 "
                "--truth-views 0 --startup-loss-seconds 0 --drop 0 --gain 0.2 --white-balance 0.1 "
                "--offset 0.02 -q")
                .exit_code,
            0);
  const std::string rig = (folder.path() / "rig.json").string();
  const std::string command = "raystage calibrate color --scene " + take + " --initial-rig " +
                              colourless_rig_of(take) + " -q -o " + rig;
  const CommandResult wrong = run(command + " --near 0.2 --far 0.21");
  EXPECT_EQ(wrong.exit_code, 1) << wrong.out << wrong.err;
  EXPECT_THAT(wrong.out, HasSubstr("Rejected"));
  EXPECT_FALSE(std::filesystem::exists(rig));
  EXPECT_EQ(run(command + " --near 3 --far 2").exit_code, 2);
  const CommandResult found = run(command + " --json");
  ASSERT_EQ(found.exit_code, 0) << found.out << found.err;
  const auto report = nlohmann::json::parse(found.out);
  const auto& step = report.at("steps").at(0);
  EXPECT_TRUE(report.at("vouched_for").get<bool>());
  EXPECT_EQ(report.at("cameras").size(), 6U);
  EXPECT_LT(step.at("after").at("mean_ciede2000"),
            step.at("before").at("mean_ciede2000").get<double>() / 4);
  const schemas::RigDocument truth = schemas::read_rig(write_true_rig(take)),
                             measured = schemas::read_rig(rig);
  const rig::PictureSize size{320, 240};
  const auto light_made_of = [&](std::size_t camera, double light) {
    const schemas::Rgb shown = rig::invert_photometric_correction(
        truth.cameras[camera].photometric, size, 160, 120, {light, light, light});
    return rig::apply_photometric_correction(measured.cameras[camera].photometric, size, 160, 120,
                                             shown);
  };
  for (std::size_t i = 0; i < truth.cameras.size(); ++i) {
    for (const double light : {0.2, 0.5}) {
      const schemas::Rgb expected = light_made_of(0, light), made = light_made_of(i, light);
      for (std::size_t k = 0; k < 3; ++k)
        EXPECT_NEAR(made[k], expected[k], 0.01 * expected[k]) << i;
    }
  }
}

TEST(CalibrateColor, AChartTellsWhatChannelsSeeOfEachOther) {
  const testing::TestFolder folder;
  const auto take = [&](const std::string& target) { return (folder.path() / target).string(); };
  const auto simulate = [&](const std::string& target) {
    return run("raystage simulate " + target + " -o " + take(target) +
               " --rows 1 --columns 3 --seconds 0.5 --fps 10 --width 480 --height 360 "
               "--truth-views 0 --startup-loss-seconds 0 --drop 0 --quality 95 --gain 0.2 "
               "--white-balance 0.1 --offset 0.02 --vignetting 0.3 --color-mix 0.15 --calibration "
               "nominal -q")
        .exit_code;
  };
  for (const char* target : {"white", "grey", "black", "color_chart"}) {
    ASSERT_EQ(simulate(target), 0);
  }
  const std::string rig = (folder.path() / "rig.json").string();
  const CommandResult nowhere =
      run("raystage calibrate color --chart " + take("grey") + " -o " + rig);
  EXPECT_EQ(nowhere.exit_code, 1) << nowhere.out << nowhere.err;
  EXPECT_THAT(nowhere.out, HasSubstr("was not found by"));
  const std::string command = "raystage calibrate color " + take("white") + " " + take("grey") +
                              " --dark " + take("black") + " --vignetting --chart " +
                              take("color_chart") + " -o " + rig;
  const schemas::RigDocument truth = schemas::read_rig(write_true_rig(take("color_chart")));
  const rig::PictureSize size{480, 360};
  const auto made_of = [&](std::size_t camera, const schemas::Rgb& light) {
    const schemas::Rgb shown =
        rig::invert_photometric_correction(truth.cameras[camera].photometric, size, 100, 60, light);
    return rig::apply_photometric_correction(schemas::read_rig(rig).cameras[camera].photometric,
                                             size, 100, 60, shown);
  };
  const schemas::Rgb lights[] = {
      {0.5, 0.5, 0.5}, {0.4, 0.1, 0.1}, {0.1, 0.3, 0.1}, {0.1, 0.15, 0.4}};
  const CommandResult alike = run(command);
  ASSERT_EQ(alike.exit_code, 0) << alike.out << alike.err;
  for (const schemas::Rgb& light : lights) {
    const schemas::Rgb expected = made_of(0, light);
    for (const std::size_t camera : {1, 2}) {
      const schemas::Rgb made = made_of(camera, light);
      for (std::size_t k = 0; k < 3; ++k) {
        EXPECT_NEAR(made[k], expected[k], 0.01 * light[1] + 0.005) << camera;
      }
    }
  }
  const CommandResult published = run(command + " --reference-values --json");
  ASSERT_EQ(published.exit_code, 0) << published.out << published.err;
  EXPECT_EQ(nlohmann::json::parse(published.out).at("steps").size(), 2U);
  const double scale = made_of(0, lights[0])[1] / 0.5;
  for (const schemas::Rgb& light : lights) {
    for (const std::size_t camera : {0, 1, 2}) {
      const schemas::Rgb made = made_of(camera, light);
      for (std::size_t k = 0; k < 3; ++k) {
        EXPECT_NEAR(made[k], scale * light[k], 0.03 * light[k] + 0.005) << camera;
      }
    }
  }
}

}  // namespace
}  // namespace raystage
