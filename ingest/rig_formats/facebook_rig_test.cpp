// SPDX-License-Identifier: Apache-2.0
// Tests rigs of facebook360_dep: formulas, round trips, damage.
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
#include "testing/test_data.h"

namespace raystage::ingest::facebook_rig_test {
namespace {

using nlohmann::json;
using schemas::Projection;
using ::testing::AllOf;
using testing::document_of;
using ::testing::ElementsAre;
using testing::expect_same;
using testing::export_refusal;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::parse_rig_files;
using testing::rewritten;
using testing::rig_of_fisheyes;
using testing::rig_refusal;
using testing::turned_camera;

json facebook_camera(const std::string& id) {
  return {{"version", 1},          {"type", "FTHETA"},       {"id", id},
          {"origin", {0, 0, 1}},   {"right", {1, 0, 0}},     {"up", {0, 1, 0}},
          {"forward", {0, 0, -1}}, {"resolution", {64, 48}}, {"focal", {20, -20}}};
}
json facebook_rig() { return {{"cameras", {facebook_camera("cam0"), facebook_camera("cam1")}}}; }

class RealRig : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto folder = testing::test_data() / "facebook360";
    if (!file_exists(folder / "rig.json")) {
      GTEST_SKIP() << "no captured data: " << (folder / "rig.json").string();
    }
    text_ = read_file(folder / "rig.json");
    document_ = document_of(parse_rig_files("facebook360", {text_}));
  }
  std::string text_;
  schemas::RigDocument document_;
};

// The values were computed independently from the formulas of facebook360_dep.
TEST_F(RealRig, ProjectsAsFacebook360Does) {
  ASSERT_EQ(document_.cameras.size(), 16u);
  const rig::Rig rig = rig::rig_from_document(document_);
  struct Check {
    std::size_t camera;
    Eigen::Vector3d point;
    Eigen::Vector2d pixel;
  };
  for (const Check& check :
       {Check{0, {2.2019202736, -1.7274010048, -2.8736274043}, {2311.936181, 1398.870338}},
        Check{5, {-3.6646461122, 0.2719760593, 1.6032763331}, {2305.210895, 1422.336477}}}) {
    const rig::Rig::Camera& camera = rig.cameras[check.camera];
    EXPECT_EQ(camera.id, fmt::format("cam{}", check.camera));
    const Eigen::Vector3d x_in_camera = camera.pose.camera_from_world(check.point);
    const auto pixel = camera.model.project(x_in_camera);
    ASSERT_TRUE(pixel);
    EXPECT_NEAR(pixel->x(), check.pixel.x(), 1e-6);
    EXPECT_NEAR(pixel->y(), check.pixel.y(), 1e-6);
    const double theta = std::atan2(x_in_camera.head<2>().norm(), -x_in_camera.z());
    EXPECT_NEAR(theta * 180 / std::numbers::pi, 36.699225, 1e-6);
  }
}

TEST_F(RealRig, IsWrittenAndReadWithoutLoss) {
  expect_same(rewritten("facebook360", document_), document_);
  for (const auto& camera : document_.cameras) {
    EXPECT_EQ(camera.geometry.intrinsics.half_angle, 1.57079632679);
  }
  EXPECT_THAT(rig_format("facebook360").format(document_).notes, IsEmpty());
}

TEST_F(RealRig, IsWrittenInOtherFormatsButForItsHalfAngles) {
  schemas::RigDocument expected = document_;
  for (auto& camera : expected.cameras) {
    camera.geometry.intrinsics.projection = Projection::kFisheye;
    camera.geometry.intrinsics.half_angle.reset();
  }
  std::ranges::sort(expected.cameras, {}, [](const auto& c) { return c.geometry.id; });
  for (const char* format : {"google", "colmap", "nerf"}) {
    SCOPED_TRACE(format);
    EXPECT_THAT(rig_format(format).format(document_).notes,
                ElementsAre(HasSubstr("half angles of 16 cameras")));
    schemas::RigDocument found = rewritten(format, document_);
    std::ranges::sort(found.cameras, {}, [](const auto& c) { return c.geometry.id; });
    expect_same(found, expected);
  }
}

TEST_F(RealRig, AbsentPropertiesHaveDefaults) {
  for (const char* file : {"ftheta.json", "orthographic.json", "rectilinear.json"}) {
    const ForeignRig rig =
        parse_rig_files("facebook360", {read_file(testing::test_data() / "facebook360" / file)});
    ASSERT_EQ(rig.cameras.size(), 1u);
    const schemas::CameraGeometry& camera = rig.cameras[0].geometry;
    EXPECT_EQ(camera.intrinsics.cx, camera.width / 2.0);
    EXPECT_EQ(camera.intrinsics.cy, camera.height / 2.0);
    EXPECT_EQ(camera.intrinsics.radial_distortion, (std::array<double, 4>{}));
    EXPECT_EQ(camera.intrinsics.half_angle, std::nullopt);
  }
  const ForeignRig rig = parse_rig_files(
      "facebook360", {read_file(testing::test_data() / "facebook360" / "sample_rig.json")});
  EXPECT_EQ(rig.cameras[1].geometry.intrinsics, (schemas::Intrinsics{1270, 1270, 1024, 1024, {}}));
}

TEST(FacebookRig, ReadsEveryTypeAndAnisotropicPixels) {
  struct Type {
    const char* name;
    double (*distance)(double);
  };
  for (const Type& type : {Type{"FTHETA", [](double a) { return a; }},
                           Type{"RECTILINEAR", [](double a) { return std::tan(a); }},
                           Type{"EQUISOLID", [](double a) { return 2 * std::sin(a / 2); }},
                           Type{"ORTHOGRAPHIC", [](double a) { return std::sin(a); }}}) {
    json document = facebook_camera("cam0");
    document.update({{"type", type.name}, {"focal", {20, -30}}, {"distortion", {-0.02, 3e-3}}});
    const auto rig =
        rig::rig_from_document(document_of(parse_rig_files("facebook360", {document.dump()})));
    for (const double angle : {0.05, 0.4, 1.0}) {
      const double r = type.distance(angle);
      const double distorted = r - 0.02 * std::pow(r, 3) + 3e-3 * std::pow(r, 5);
      // To the right and up: y of pixels is down.
      const Eigen::Vector3d x(std::sin(angle) * 0.6, std::sin(angle) * 0.8, -std::cos(angle));
      const auto pixel = rig.cameras[0].model.project(x);
      ASSERT_TRUE(pixel) << type.name;
      EXPECT_NEAR(pixel->x(), 32 + 20 * distorted * 0.6, 1e-9) << type.name;
      EXPECT_NEAR(pixel->y(), 24 - 30 * distorted * 0.8, 1e-9) << type.name;
    }
  }
}

TEST(FacebookRig, IgnoresTheAngleOfPinholesWithANote) {
  json document = facebook_rig();
  document["cameras"][1].update({{"type", "RECTILINEAR"}, {"fov", 1.2}});
  EXPECT_THAT(parse_rig_files("facebook360", {document.dump()}).notes,
              ElementsAre(HasSubstr("\"fov\" of 1 RECTILINEAR")));
}

TEST(FacebookRig, AxesAreMadeOrthonormal) {
  json document = facebook_rig();
  document["cameras"][0]["right"] = {1.0004, 0.0003, 0};
  const auto rig =
      document_of(parse_rig_files("facebook360", {document.dump()}));  // our document checks it
  EXPECT_NEAR(rig.cameras[0].geometry.world_from_camera[0], 1, 1e-6);
}

TEST(FacebookRig, BadRigsAreRefusedAtThePlace) {
  struct Case {
    const char* pointer;
    json value;
    const char* message;
  };
  json many = json::array();
  for (int i = 0; i < 10'001; ++i) many.push_back(facebook_camera("c"));
  for (const Case& c : std::initializer_list<Case>{
           {"/cameras", json::array(), "rig.json#/cameras: found an array of 0"},
           {"/cameras", many, "rig.json#/cameras: found an array of 10001"},
           {"/cameras", 5, "rig.json#/cameras: found 5"},
           {"/cameras/1", nullptr, "rig.json#/cameras/1: found null"},
           {"/cameras/1/id", "../../etc", "#/cameras/1/id: found \"../../etc\""},
           {"/cameras/1/id", "a/b", "#/cameras/1/id: found \"a/b\""},
           {"/cameras/1/id", 7, "#/cameras/1/id: found 7"},
           {"/cameras/1/id", "cam0", "#/cameras/1/id: the id \"cam0\" is used twice"},
           {"/cameras/1/type", "FISHEYE", "#/cameras/1/type: found \"FISHEYE\""},
           {"/cameras/1/version", 2, "#/cameras/1/version: found 2"},
           {"/cameras/1/resolution", {0, 48}, "#/cameras/1/resolution/0: found 0"},
           {"/cameras/1/resolution", {1e9, 48}, "#/cameras/1/resolution/0: found 1000000000"},
           {"/cameras/1/resolution", {64.5, 48}, "#/cameras/1/resolution/0: found 64.5"},
           {"/cameras/1/focal", {20, 20}, "#/cameras/1/focal: found [20,20]"},
           {"/cameras/1/focal", {0, -20}, "#/cameras/1/focal: found [0,-20]"},
           {"/cameras/1/focal", {20}, "#/cameras/1/focal: found an array of 1"},
           {"/cameras/1/distortion", {0, 0, 0, 0}, "#/cameras/1/distortion: found an array of 4"},
           {"/cameras/1/fov", 4, "#/cameras/1/fov: found 4"},
           {"/cameras/1/fov", "wide", "#/cameras/1/fov: found \"wide\""},
           {"/cameras/1/right", {0.9, 0, 0}, "#/cameras/1: the axes are not orthonormal"},
           {"/cameras/1/right", {0, 0, 0}, "#/cameras/1: the axes are not orthonormal"},
           {"/cameras/1/right", {-1, 0, 0}, "#/cameras/1: the axes are left-handed"},
           {"/cameras/1/up", {0, 1, 0, 0}, "#/cameras/1/up: found an array of 4"},
           {"/cameras/1/origin", {0, 0, 1e10}, "#/cameras/1/origin/2"}}) {
    json document = facebook_rig();
    document[json::json_pointer(c.pointer)] = c.value;
    EXPECT_THAT(rig_refusal("facebook360", {document.dump()}), HasSubstr(c.message)) << c.pointer;
  }
  for (const char* text : {"", "{", "[]", "{\"cameras\": [NaN]}", "{\"cameras\": [1e999]}"}) {
    EXPECT_THAT(rig_refusal("facebook360", {text}), HasSubstr("rig.json")) << text;
  }
}

TEST(FacebookRig, LensesThatItCannotHoldAreRefusedByName) {
  schemas::RigDocument rig = rig_of_fisheyes(Projection::kEquisolid);
  expect_same(rewritten("facebook360", rig), rig);
  rig.cameras[1].geometry.intrinsics.radial_distortion[3] = 1e-3;
  EXPECT_THAT(export_refusal("facebook360", rig),
              AllOf(HasSubstr("camera \"c4\""), HasSubstr("equisolid lens"), HasSubstr("three")));
  schemas::RigDocument pinholes;
  pinholes.cameras.push_back({turned_camera("a", 1, Projection::kPinhole), {}});
  pinholes.cameras[0].geometry.intrinsics.distortion = {.k1 = 0.1, .k2 = 0.2, .k3 = 0.3};
  expect_same(rewritten("facebook360", pinholes), pinholes);
  pinholes.cameras[0].geometry.intrinsics.distortion.p2 = 1e-3;
  EXPECT_THAT(export_refusal("facebook360", pinholes),
              AllOf(HasSubstr("camera \"a\""), HasSubstr("pinhole lens"), HasSubstr("p1, p2")));
}

}  // namespace
}  // namespace raystage::ingest::facebook_rig_test
