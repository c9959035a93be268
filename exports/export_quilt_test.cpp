// SPDX-License-Identifier: Apache-2.0
#include "exports/export_quilt.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/transfer_function.h"
#include "testing/exports/export_test_data.h"
#include "testing/render/synthetic_take.h"

namespace raystage::exports::export_quilt_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::output_of_program;

/// Returns the linear RGB of a waved plane at (x, y), metres.
std::array<double, 3> waves(double x, double y) {
  const double wave = std::sin(9 * x) * std::cos(7 * y);
  return {0.4 + 0.25 * wave, 0.4 + 0.2 * std::sin(6 * x + 5 * y), 0.3 - 0.2 * wave};
}
/// The plane is 4 m away.
std::array<double, 3> waved_plane(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
  const double t = (-4 - origin.z()) / direction.z();
  const Eigen::Vector3d at = origin + t * direction;
  return waves(at.x(), at.y());
}

/// A waved plane seen by 3 x 3 cameras.
class ExportQuilt : public ::testing::Test {
 protected:
  void SetUp() override {
    testing::SyntheticTake scene;
    scene.cameras = testing::camera_grid(3, 3, 0.2, 120, 90);
    scene.depth_range = schemas::DepthRange{3, 5};
    scene.scene = waved_plane;
    scene.frames = 2;
    write_synthetic_take(scene, folder_.path() / "take");
    options_.input = folder_.path() / "take";
    options_.output = folder_.path() / "q.png";
    options_.columns = 2;
    options_.rows = 3;
    options_.view_width = 60;
    options_.aspect = 0.75;
    options_.screen_m = 3;
    options_.baseline_m = 0.3;
    options_.method = "plane_sweep";
  }
  store::RgbImage read(const std::filesystem::path& file, int width, int height) const {
    output_of_program({"ffmpeg", "-nostdin", "-v", "error", "-y", "-i", file.string(), "-f",
                       "rawvideo", "-pix_fmt", "rgb24", (folder_.path() / "raw").string()});
    const std::string raw = read_file(folder_.path() / "raw");
    EXPECT_EQ(raw.size(), std::size_t{3} * width * height);
    return {width, height, std::vector<std::uint8_t>(raw.begin(), raw.end())};
  }
  testing::TestFolder folder_;
  QuiltExportOptions options_;
};

TEST(QuiltName, TellsTheLayout) {
  EXPECT_EQ(quilt_name("a/shot.png", 8, 6, 0.75), "a/shot_qs8x6a0.75.png");
  EXPECT_EQ(quilt_name("shot.####.png", 5, 9, 16.0 / 9), "shot.####_qs5x9a1.778.png");
  EXPECT_EQ(quilt_name("shot_qs8x6a0.75.mp4", 8, 6, 0.75), "shot_qs8x6a0.75.mp4");
  EXPECT_EQ(quilt_name("shot_qs8x6a0.75.mp4", 4, 6, 0.75), "shot_qs8x6a0.75_qs4x6a0.75.mp4");
}

TEST_F(ExportQuilt, ViewsFollowFromTheLowerLeft) {
  const QuiltReport report = export_quilt(options_, {});
  EXPECT_EQ(report.exit_code(), ExitCode::kSuccess);
  EXPECT_EQ(report.views, 6);
  EXPECT_EQ(report.files, (folder_.path() / "q_qs2x3a0.75.png").string());
  const store::RgbImage quilt = read(report.files, 120, 240);
  // Each view is a pinhole's, shifted so that the plane at 3 m has no disparity.
  const double focal = 36 * (120 / (2 * std::tan(31 * M_PI / 180))) / 120;  // mm, of the cameras
  const double zoom = (120.0 / 90) / 0.75;
  const double pixels = focal / 36 * zoom * 60;  // focal length of a view
  double sum = 0;
  int count = 0;
  for (int view = 0; view < 6; ++view) {
    const double offset = (view / 5.0 - 0.5) * 0.3;
    const int left = view % 2 * 60, top = (2 - view / 2) * 80;
    for (int y = 10; y < 70; ++y) {
      for (int x = 8; x < 52; ++x) {
        const double ideal_x = (x + 0.5 - 30) / pixels - offset / 3;
        const double ideal_y = (40 - y - 0.5) / pixels;
        const auto linear = waves(offset + 4 * ideal_x, 4 * ideal_y);
        for (int c = 0; c < 3; ++c) {
          const double expected = 255 * srgb_from_linear(linear[c]);
          sum += std::pow(quilt.at(left + x, top + y, c) - expected, 2);
          ++count;
        }
      }
    }
  }
  EXPECT_LT(std::sqrt(sum / count), 1.4);  // codes
}

TEST_F(ExportQuilt, ARowOfTheArrayIsRectified) {
  testing::SyntheticTake scene;
  scene.cameras = testing::camera_grid(3, 3, 0.2, 120, 90);
  // The cameras of the middle row are turned by up to 3 degrees.
  for (std::size_t i = 0; i < scene.cameras.size(); ++i) {
    scene.cameras[i].row = static_cast<int>(i / 3);
    scene.cameras[i].column = static_cast<int>(2 - i % 3);  // columns count from the right
    const double angle = (static_cast<double>(i % 3) - 1) * 3 * M_PI / 180;
    auto& m = scene.cameras[i].world_from_camera;
    m[0] = m[10] = std::cos(angle);
    m[2] = std::sin(angle);
    m[8] = -m[2];
  }
  scene.depth_range = schemas::DepthRange{3, 5};
  scene.scene = waved_plane;
  options_.input = folder_.path() / "turned";
  write_synthetic_take(scene, options_.input);
  options_.array_row = 1;
  options_.aspect = 0.75;
  const QuiltReport report = export_quilt(options_, {});
  EXPECT_EQ(report.views, 3);
  EXPECT_NEAR(report.baseline_m, 0.4, 1e-9);
  EXPECT_EQ(report.files, (folder_.path() / "q_qs3x1a0.75.png").string());
  const store::RgbImage quilt = read(report.files, 180, 80);
  const double pixels = 120 / (2 * std::tan(31 * M_PI / 180)) / 120 * (120.0 / 90) / 0.75 * 60;
  double sum = 0;
  int count = 0;
  for (int view = 0; view < 3; ++view) {
    const double offset = (view - 1) * 0.2;  // from the left, whatever the columns say
    for (int y = 10; y < 70; ++y) {
      for (int x = 12; x < 48; ++x) {
        const double ideal_x = (x + 0.5 - 30) / pixels - offset / 3;
        const double ideal_y = (40 - y - 0.5) / pixels;
        const auto linear = waves(offset + 4 * ideal_x, 4 * ideal_y);
        for (int c = 0; c < 3; ++c) {
          const double expected = 255 * srgb_from_linear(linear[c]);
          sum += std::pow(quilt.at(view * 60 + x, y, c) - expected, 2);
          ++count;
        }
      }
    }
  }
  EXPECT_LT(std::sqrt(sum / count), 1.4);  // codes
  options_.array_row = 3;
  EXPECT_THROW(export_quilt(options_, {}), Error);
}

TEST_F(ExportQuilt, FramesBecomePicturesOrAMovie) {
  options_.frames = std::vector{1, 2};
  EXPECT_THROW(export_quilt(options_, {}), Error);  // no number in the name
  options_.output = folder_.path() / "q.####.png";
  EXPECT_EQ(export_quilt(options_, {}).frames, 2);
  EXPECT_TRUE(std::filesystem::exists(folder_.path() / "q.0002_qs2x3a0.75.png"));
  EXPECT_THROW(export_quilt(options_, {}), Error);  // exist
  options_.existing = ExistingFiles::kOverwrite;
  export_quilt(options_, {});
  options_.output = folder_.path() / "q.mp4";
  options_.frames.reset();
  export_quilt(options_, {});
  const auto probed = nlohmann::json::parse(
      output_of_program({"ffprobe", "-v", "error", "-count_frames", "-show_streams", "-of", "json",
                         (folder_.path() / "q_qs2x3a0.75.mp4").string()}));
  EXPECT_EQ(probed["streams"][0]["nb_read_frames"], "2");
  EXPECT_EQ(probed["streams"][0]["width"], 120);
  EXPECT_EQ(probed["streams"][0]["r_frame_rate"], "15/1");
}

TEST_F(ExportQuilt, WhatIsWrongIsNamed) {
  const auto refusal = [&] {
    try {
      export_quilt(options_, {});
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  options_.frames = std::vector{3};
  EXPECT_THAT(refusal(), HasSubstr("frame 3 is not in the shot"));
  options_.frames.reset();
  options_.method = "no_such_method";
  EXPECT_THAT(refusal(), AllOf(HasSubstr("no_such_method"), HasSubstr(options_.input.string()),
                               Not(HasSubstr("shot.json"))));
  options_.method = "";
  options_.view_width = 8192;
  options_.columns = 64;
  EXPECT_THROW(export_quilt(options_, {}), Error);
  options_.columns = 65;
  EXPECT_THROW(export_quilt(options_, {}), Error);
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "q_qs2x3a0.75.png"));
}

}  // namespace
}  // namespace raystage::exports::export_quilt_test
