// SPDX-License-Identifier: Apache-2.0
// Tests what all formats of rigs share, and fisheyes of transforms.json.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "ingest/rig_formats/rig_format.h"
#include "rig/rig.h"
#include "testing/ingest/rig_format_test_data.h"

namespace raystage::ingest::rig_formats_test {
namespace {

using nlohmann::json;
using schemas::Projection;
using ::testing::AllOf;
using ::testing::ElementsAre;
using testing::expect_same;
using testing::export_refusal;
using ::testing::HasSubstr;
using testing::parse_rig_files;
using testing::rewritten;
using testing::rig_of_fisheyes;
using testing::rig_refusal;
using testing::turned_camera;

TEST(NerfTransforms, ReadFisheyes) {
  json document = {{"camera_model", "OPENCV_FISHEYE"},
                   {"w", 64},
                   {"h", 48},
                   {"fl_x", 20},
                   {"fl_y", 21},
                   {"k1", 0.1},
                   {"k4", -0.2}};
  document["frames"] = {{{"file_path", "a.png"},
                         {"k2", 0.3},
                         {"transform_matrix", {{1, 0, 0, 1}, {0, 1, 0, 2}, {0, 0, 1, 3}}}}};
  const ForeignRig rig = parse_rig_files("nerf", {document.dump()});
  schemas::Intrinsics lens{20, 21, 32, 24, {}, Projection::kFisheye};
  lens.radial_distortion = {0.1, 0.3, 0, -0.2};
  EXPECT_EQ(rig.cameras.at(0).geometry.intrinsics, lens);
  document["p1"] = 0.1;
  EXPECT_THAT(rig_refusal("nerf", {document.dump()}),
              HasSubstr("transforms.json#/frames/0: found \"p1\" 0.1"));
  document.erase("p1");
  document.erase("w");
  EXPECT_THAT(rig_refusal("nerf", {document.dump()}), HasSubstr("\"w\" and \"h\""));
}

TEST(NerfTransforms, AreWrittenAndReadWithoutLoss) {
  schemas::RigDocument rig = rig_of_fisheyes(Projection::kFisheye);
  rig.cameras[1].geometry.intrinsics.radial_distortion[3] = 1e-6;
  expect_same(rewritten("nerf", rig), rig);
  schemas::RigDocument pinholes;
  pinholes.cameras.push_back({turned_camera("a.b", 1, Projection::kPinhole), {}});
  pinholes.cameras[0].geometry.intrinsics.distortion = {0.1, 0.2, 0.3, 0.4, 0.5};
  expect_same(rewritten("nerf", pinholes), pinholes);
  rig.cameras.push_back(pinholes.cameras[0]);
  EXPECT_THAT(export_refusal("nerf", rig), AllOf(HasSubstr("camera \"a.b\""), HasSubstr("OPENCV")));
  EXPECT_THAT(export_refusal("nerf", rig_of_fisheyes(Projection::kOrthographic)),
              AllOf(HasSubstr("camera \"c0\""), HasSubstr("orthographic lens")));
}

// Pixel centres are at +0.5 in all formats: a principal point of 0.5 is the first pixel's centre.
TEST(RigFormats, HavePixelCentresAtAHalf) {
  const json google = {{{"name", "a"},
                        {"width", 64},
                        {"height", 48},
                        {"focal_length", 20},
                        {"principal_point", {0.5, 0.5}},
                        {"orientation", {0, 0, 0}},
                        {"position", {0, 0, 0}},
                        {"projection_type", "fisheye"}}};
  const json facebook = {{"version", 1},           {"type", "FTHETA"},       {"id", "a"},
                         {"origin", {0, 0, 1}},    {"right", {1, 0, 0}},     {"up", {0, 1, 0}},
                         {"forward", {0, 0, -1}},  {"resolution", {64, 48}}, {"focal", {20, -20}},
                         {"principal", {0.5, 0.5}}};
  json nerf = {{"w", 64}, {"h", 48}, {"fl_x", 20}, {"cx", 0.5}, {"cy", 0.5}};
  nerf["frames"] = {
      {{"file_path", "a.png"}, {"transform_matrix", {{1, 0, 0, 1}, {0, 1, 0, 2}, {0, 0, 1, 3}}}}};
  for (const ForeignRig& rig :
       {parse_rig_files("google", {google.dump()}),
        parse_rig_files("facebook360", {facebook.dump()}), parse_rig_files("nerf", {nerf.dump()}),
        parse_rig_files("colmap",
                        {"7 PINHOLE 64 48 20 20 0.5 0.5\n", "1 1 0 0 0 0 0 0 7 a.png\n\n"})}) {
    const auto ray = rig::CameraModel(rig.cameras.at(0).geometry).unproject({0.5, 0.5});
    ASSERT_TRUE(ray);
    EXPECT_EQ(*ray, Eigen::Vector3d(0, 0, -1));
  }
}

TEST(RigFormats, HaveAtMostTenThousandCameras) {
  constexpr int kMost = 10'000;
  const auto nerf = [](int count) {
    json document = {{"w", 64}, {"h", 48}, {"fl_x", 20}};
    const json frame = {{"file_path", "same.png"},
                        {"transform_matrix", {{1, 0, 0, 1}, {0, 1, 0, 2}, {0, 0, 1, 3}}}};
    document["frames"] = json(static_cast<std::size_t>(count), frame);
    return document.dump();
  };
  const ForeignRig most = parse_rig_files("nerf", {nerf(kMost)});
  EXPECT_EQ(most.cameras.front().geometry.id, "same");
  EXPECT_EQ(most.cameras.back().geometry.id, "same-10000");
  EXPECT_THAT(rig_refusal("nerf", {nerf(kMost + 1)}),
              HasSubstr("transforms.json#/frames: found an array of 10001"));

  std::string cameras, images;
  for (int i = 1; i <= kMost; ++i) {
    cameras += fmt::format("{} PINHOLE 48 40 50 50 24 20\n", i);
    images += "1 1 0 0 0 0 0 0 7 same.jpg\n\n";
  }
  EXPECT_EQ(parse_rig_files("colmap", {cameras, images}).cameras.back().geometry.id, "same-10000");
  EXPECT_THAT(rig_refusal("colmap", {cameras, images + "1 1 0 0 0 0 0 0 7 same.jpg\n\n"}),
              AllOf(HasSubstr("images.txt:20001"), HasSubstr("10000"), HasSubstr("fewer images")));
  EXPECT_THAT(rig_refusal("colmap", {cameras + "0 PINHOLE 48 40 50 50 24 20\n", images}),
              AllOf(HasSubstr("cameras.txt:10001"), HasSubstr("10000")));
}

TEST(RigFormats, HaveNamesThatFilesCanHave) {
  const std::string cameras = "1 PINHOLE 48 40 50 50 24 20\n", image = "1 1 0 0 0 0 0 0 1 ";
  const auto of_image = [&](const std::string& name) {
    return rig_refusal("colmap", {cameras, image + name + "\n\n"});
  };
  EXPECT_THAT(of_image(std::string(4001, 'a')), HasSubstr("4001 bytes, allowed: 4000"));
  EXPECT_THAT(of_image(std::string("a.png\0x", 7)),
              AllOf(HasSubstr("images.txt:1"), HasSubstr("control characters")));
  json document = {{"w", 64}, {"h", 48}, {"fl_x", 20}};
  document["frames"] = {{{"file_path", std::string("a.png\0x", 7)},
                         {"transform_matrix", {{1, 0, 0, 1}, {0, 1, 0, 2}, {0, 0, 1, 3}}}}};
  EXPECT_THAT(rig_refusal("nerf", {document.dump()}),
              AllOf(HasSubstr("#/frames/0/file_path"), HasSubstr("control characters")));
}

TEST(RigFormats, StateWhatTheyDoNotHold) {
  schemas::RigDocument rig = rig_of_fisheyes(Projection::kFisheye);
  rig.cameras[0].geometry.line_time_us = 12;
  rig.cameras[1].geometry.row = rig.cameras[1].geometry.column = 1;
  rig.cameras[2].photometric.contrast = {2, 2, 2};
  for (const RigFormat* format : rig_formats()) {
    EXPECT_THAT(format->format(rig).notes,
                ElementsAre(HasSubstr("line times of the rolling shutters of 1 camera "),
                            HasSubstr("photometric responses"), HasSubstr("rows and columns")));
  }
}

TEST(RigFormats, AreKnownByTheirOutline) {
  EXPECT_EQ(detect_rig_format({true, {"name", "projection_type"}})->name(), "google");
  EXPECT_EQ(detect_rig_format({true, {"orientation", "position"}})->name(), "google");
  EXPECT_EQ(detect_rig_format({false, {"cameras"}})->name(), "facebook360");
  EXPECT_EQ(detect_rig_format({false, {"frames", "cameras"}})->name(), "nerf");
  EXPECT_EQ(detect_rig_format({false, {"schema", "cameras"}}), nullptr);
  EXPECT_EQ(detect_rig_format({true, {}}), nullptr);
}

}  // namespace
}  // namespace raystage::ingest::rig_formats_test
