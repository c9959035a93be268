// SPDX-License-Identifier: Apache-2.0
// Tests COLMAP's fisheyes and the writing of models; reading is also tested in model_import_test.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "ingest/rig_formats/rig_format.h"
#include "rig/rig.h"
#include "testing/ingest/rig_format_test_data.h"

namespace raystage::ingest::colmap_fisheyes_test {
namespace {

using schemas::Projection;
using ::testing::AllOf;
using testing::document_of;
using ::testing::ElementsAre;
using testing::expect_same;
using testing::export_refusal;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::parse_rig_files;
using testing::rewritten;
using testing::rig_of_fisheyes;
using testing::rig_refusal;
using testing::turned_camera;

constexpr const char* kImages = "1 1 0 0 0 0 0 0 7 a.jpg\n\n";

schemas::Intrinsics colmap_lens(const std::string& camera) {
  return parse_rig_files("colmap", {"7 " + camera + "\n", kImages})
      .cameras.at(0)
      .geometry.intrinsics;
}

TEST(ColmapFisheyes, AreReadExactly) {
  schemas::Intrinsics lens{50, 50, 24, 20, {}, Projection::kFisheye};
  lens.radial_distortion = {0.1, 0, 0, 0};
  EXPECT_EQ(colmap_lens("SIMPLE_RADIAL_FISHEYE 48 40 50 24 20 0.1"), lens);
  lens.radial_distortion = {0.1, 0.2, 0, 0};
  EXPECT_EQ(colmap_lens("RADIAL_FISHEYE 48 40 50 24 20 0.1 0.2"), lens);
  lens.fy = 51;
  lens.radial_distortion = {0.1, 0.2, 0.3, 0.4};
  EXPECT_EQ(colmap_lens("OPENCV_FISHEYE 48 40 50 51 24 20 0.1 0.2 0.3 0.4"), lens);
  EXPECT_EQ(colmap_lens("THIN_PRISM_FISHEYE 48 40 50 51 24 20 0.1 0.2 0 0 0.3 0.4 0 0"), lens);
  EXPECT_THAT(
      rig_refusal("colmap",
                  {"7 THIN_PRISM_FISHEYE 48 40 50 51 24 20 0.1 0.2 0 0 0.3 0.4 1e-3 0\n", kImages}),
      AllOf(HasSubstr("cameras.txt:1"), HasSubstr("THIN_PRISM_FISHEYE"), HasSubstr("sx1")));
  EXPECT_THAT(rig_refusal("colmap", {"7 RAD_TAN_THIN_PRISM_FISHEYE 48 40 50\n", kImages}),
              AllOf(HasSubstr("cameras.txt:1"), HasSubstr("RAD_TAN_THIN_PRISM_FISHEYE")));
}

// To export the model again would not help.
TEST(ColmapFisheyes, UnsupportedLensesHaveOneAdvice) {
  for (const char* camera :
       {"RAD_TAN_THIN_PRISM_FISHEYE 48 40 50", "FOV 3000 2000 1000 1000 1500 1000 1.2",
        "FOV 4000 4000 1000 1000 2000 2000 2.2",
        "THIN_PRISM_FISHEYE 48 40 50 51 24 20 0.1 0.2 0 0 0.3 0.4 1e-3 0"}) {
    EXPECT_THAT(rig_refusal("colmap", {fmt::format("7 {}\n", camera), kImages}),
                AllOf(HasSubstr("Undistort the images"), Not(HasSubstr("Export")),
                      Not(HasSubstr("; undistort"))))
        << camera;
  }
}

// Otherwise the import would name a place in the rig.json to be written.
TEST(ColmapModels, ValuesBeyondThoseOfARigAreRefusedAtTheirPlace) {
  const auto refusal = [](const std::string& camera, const std::string& pose) {
    const std::vector<std::string> texts{"7 " + camera + "\n", "1 " + pose + " 7 a.jpg\n\n"};
    const std::string text = rig_refusal("colmap", texts);
    if (text == "accepted") document_of(parse_rig_files("colmap", texts));  // throws if it should
    return text;
  };
  const std::string pinhole = "PINHOLE 48 40 50 50 24 20", here = "1 0 0 0 0 0 0";
  EXPECT_EQ(refusal("OPENCV 48 40 50 50 1e7 20 1e6 0 0 -1e6", here), "accepted");
  for (const char* camera :
       {"SIMPLE_RADIAL_FISHEYE 48 40 50 24 20 5e6", "SIMPLE_RADIAL 48 40 50 24 20 -1.1e6",
        "OPENCV 48 40 50 50 24 20 0 0 0 2e6"}) {
    EXPECT_THAT(refusal(camera, here),
                AllOf(HasSubstr("cameras.txt:1"), HasSubstr("allowed: up to 1000000")));
  }
  // A rotation by 45 degrees about y: the coordinates of the translation are within the limit.
  EXPECT_THAT(refusal(pinhole, "0.9238795325 0 0.3826834324 0 9e8 0 9e8"),
              AllOf(HasSubstr("images.txt:1"), HasSubstr("position of the camera")));
}

/// Returns the largest distance of the pixels of one ray by the FOV model and by ours, over the
/// picture.
double fov_error(double f, double omega, int width, int height) {
  const ForeignRig foreign =
      parse_rig_files("colmap", {fmt::format("7 FOV {} {} {} {} {} {} {}\n", width, height, f, f,
                                             width / 2.0, height / 2.0, omega),
                                 kImages});
  EXPECT_THAT(foreign.notes, ElementsAre(AllOf(HasSubstr("cameras.txt:1"), HasSubstr("px off"))));
  const rig::CameraModel model(foreign.cameras.at(0).geometry);
  double worst = 0;
  for (int y = 0; y <= height; y += 20) {
    for (int x = 0; x <= width; x += 20) {
      const Eigen::Vector2d pixel(x, y);
      const Eigen::Vector2d image = (pixel - Eigen::Vector2d(width / 2.0, height / 2.0)) / f;
      const double distorted = image.norm();
      if (distorted == 0 || distorted * omega >= std::numbers::pi / 2) continue;
      const double r = std::tan(distorted * omega) / (2 * std::tan(omega / 2));
      const Eigen::Vector2d ideal = image / distorted * r;
      const auto projected = model.project({ideal.x(), -ideal.y(), -1});
      EXPECT_TRUE(projected);
      if (projected) worst = std::max(worst, (*projected - pixel).norm());
    }
  }
  return worst;
}

TEST(ColmapFisheyes, FovIsApproximatedWithinAHundredthOfAPixel) {
  for (const double omega : {0.4, 0.7, 0.9, 1.0}) {
    EXPECT_LT(fov_error(800, omega, 1280, 960), 0.01) << omega;
  }
  EXPECT_LT(fov_error(400, 0.93, 1280, 960), 0.01);
  EXPECT_EQ(colmap_lens("FOV 48 40 50 51 24 20 0"), (schemas::Intrinsics{50, 51, 24, 20, {}}));
}

TEST(ColmapFisheyes, FovThatAFisheyeCannotApproximateIsRefused) {
  EXPECT_THAT(rig_refusal("colmap", {"7 FOV 4000 4000 1000 1000 2000 2000 2.2\n", kImages}),
              AllOf(HasSubstr("cameras.txt:1"), HasSubstr("FOV"), HasSubstr("corners")));
  EXPECT_THAT(rig_refusal("colmap", {"7 FOV 3000 2000 1000 1000 1500 1000 1.2\n", kImages}),
              AllOf(HasSubstr("cameras.txt:1"), HasSubstr("FOV"), HasSubstr("px off")));
  EXPECT_THAT(rig_refusal("colmap", {"7 FOV 48 40 50 51 24 20 3.2\n", kImages}),
              HasSubstr("omega"));
}

TEST(ColmapModels, AreWrittenAndReadWithoutLoss) {
  schemas::RigDocument rig = rig_of_fisheyes(Projection::kFisheye);
  rig.cameras[1].geometry.intrinsics.radial_distortion[3] = 1e-6;
  rig.cameras[1].geometry.intrinsics.fy += 2;
  schemas::CameraGeometry pinhole = turned_camera("p1", 0.2, Projection::kPinhole);
  rig.cameras.push_back({pinhole, {}});
  pinhole.id = "p2";
  pinhole.intrinsics.distortion = {0.1, 0.2, 0.3, 0.4, 0};
  rig.cameras.push_back({pinhole, {}});
  pinhole.id = "p3";
  pinhole.intrinsics.distortion.k3 = 0.5;
  rig.cameras.push_back({pinhole, {}});
  std::ranges::sort(rig.cameras, {}, [](const auto& c) { return c.geometry.id; });
  expect_same(rewritten("colmap", rig), rig);
  EXPECT_THAT(export_refusal("colmap", rig_of_fisheyes(Projection::kEquisolid)),
              AllOf(HasSubstr("camera \"c0\""), HasSubstr("equisolid lens")));
}

}  // namespace
}  // namespace raystage::ingest::colmap_fisheyes_test
