// SPDX-License-Identifier: Apache-2.0
// Tests that rigs of other programs are read by their formulas, written and read again without
// loss, and refused at the place of an error.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/error.h"
#include "ingest/rig_formats/rig_format.h"
#include "rig/rig.h"
#include "testing/test_data.h"

namespace raystage::ingest::rig_formats_test {
namespace {

using nlohmann::json;
using schemas::Projection;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

ForeignRig parse(std::string_view format, const std::vector<std::string>& texts) {
  const RigFormat& of_name = rig_format(format);
  std::vector<NamedText> files;
  for (std::size_t i = 0; i < texts.size(); ++i) files.push_back({of_name.files()[i], texts[i]});
  return of_name.parse(files, nullptr);
}

schemas::RigDocument document_of(const ForeignRig& rig) {
  schemas::RigDocument document;
  for (const ForeignRig::Camera& camera : rig.cameras) {
    document.cameras.push_back({camera.geometry, {}});
  }
  // As after a rig.json of ours.
  return schemas::parse_rig(schemas::format_rig(document), "rig.json");
}

/// Returns a rig after it was written and read again.
schemas::RigDocument rewritten(std::string_view format, const schemas::RigDocument& rig) {
  const ExportedRig exported = rig_format(format).format(rig);
  std::vector<std::string> texts;
  for (const NamedText& file : exported.files) texts.push_back(file.text);
  return document_of(parse(format, texts));
}

/// Returns the largest difference of two matrices.
double pose_difference(const schemas::CameraGeometry& a, const schemas::CameraGeometry& b) {
  double worst = 0;
  for (std::size_t i = 0; i < a.world_from_camera.size(); ++i) {
    worst = std::max(worst, std::abs(a.world_from_camera.at(i) - b.world_from_camera.at(i)));
  }
  return worst;
}

void expect_same(const schemas::RigDocument& found, const schemas::RigDocument& expected) {
  ASSERT_EQ(found.cameras.size(), expected.cameras.size());
  for (std::size_t i = 0; i < found.cameras.size(); ++i) {
    const schemas::CameraGeometry& a = found.cameras[i].geometry;
    const schemas::CameraGeometry& b = expected.cameras[i].geometry;
    EXPECT_EQ(a.id, b.id);
    EXPECT_EQ(a.width, b.width);
    EXPECT_EQ(a.height, b.height);
    EXPECT_EQ(a.intrinsics, b.intrinsics) << a.id;
    EXPECT_LT(pose_difference(a, b), 1e-12) << a.id;
  }
}

/// Returns a camera that is turned about several axes.
schemas::CameraGeometry turned_camera(const std::string& id, double turn, Projection projection) {
  schemas::CameraGeometry camera;
  camera.id = id;
  camera.width = 640;
  camera.height = 480;
  camera.intrinsics.fx = camera.intrinsics.fy = 201.25;
  camera.intrinsics.cx = 321.1;
  camera.intrinsics.cy = 239.7;
  camera.intrinsics.projection = projection;
  rig::Pose pose;
  pose.position = {0.1 * turn, -2, 0.3};
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(turn, Eigen::Vector3d(1, 2, -0.5).normalized()).toRotationMatrix();
  camera.world_from_camera = rig::matrix_from_pose(pose);
  return camera;
}

schemas::RigDocument rig_of_fisheyes(Projection projection) {
  schemas::RigDocument rig;
  for (const double turn : {0.0, 0.4, 2.0, std::numbers::pi}) {
    rig.cameras.push_back({turned_camera(fmt::format("c{}", turn * 10), turn, projection), {}});
    rig.cameras.back().geometry.intrinsics.radial_distortion = {-0.03 - turn / 1000, 1e-3, -1e-4,
                                                                0};
  }
  return rig;
}

std::string refusal(std::string_view format, const std::vector<std::string>& texts) {
  try {
    parse(format, texts);
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_FALSE(error.what_to_do().empty());
    return error.what();
  }
  return "accepted";
}

std::string export_refusal(std::string_view format, const schemas::RigDocument& rig) {
  try {
    rig_format(format).format(rig);
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_FALSE(error.what_to_do().empty());
    return error.what();
  }
  return "written";
}

// --- facebook360 ---

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
    document_ = document_of(parse("facebook360", {text_}));
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
        parse("facebook360", {read_file(testing::test_data() / "facebook360" / file)});
    ASSERT_EQ(rig.cameras.size(), 1u);
    const schemas::CameraGeometry& camera = rig.cameras[0].geometry;
    EXPECT_EQ(camera.intrinsics.cx, camera.width / 2.0);
    EXPECT_EQ(camera.intrinsics.cy, camera.height / 2.0);
    EXPECT_EQ(camera.intrinsics.radial_distortion, (std::array<double, 4>{}));
    EXPECT_EQ(camera.intrinsics.half_angle, std::nullopt);
  }
  const ForeignRig rig =
      parse("facebook360", {read_file(testing::test_data() / "facebook360" / "sample_rig.json")});
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
    const auto rig = rig::rig_from_document(document_of(parse("facebook360", {document.dump()})));
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
  EXPECT_THAT(parse("facebook360", {document.dump()}).notes,
              ElementsAre(HasSubstr("\"fov\" of 1 RECTILINEAR")));
}

TEST(FacebookRig, AxesAreMadeOrthonormal) {
  json document = facebook_rig();
  document["cameras"][0]["right"] = {1.0004, 0.0003, 0};
  const auto rig = document_of(parse("facebook360", {document.dump()}));  // our document checks it
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
    EXPECT_THAT(refusal("facebook360", {document.dump()}), HasSubstr(c.message)) << c.pointer;
  }
  for (const char* text : {"", "{", "[]", "{\"cameras\": [NaN]}", "{\"cameras\": [1e999]}"}) {
    EXPECT_THAT(refusal("facebook360", {text}), HasSubstr("rig.json")) << text;
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

// --- Google ---

json google_camera(const std::string& name) {
  return {{"name", name},
          {"width", 64.0},
          {"height", 48.0},
          {"focal_length", 20.5},
          {"principal_point", {31.5, 25}},
          {"radial_distortion", {0.01, -0.002}},
          {"orientation", {0.3, -1.2, 0.4}},
          {"position", {0.1, -0.2, 0.3}},
          {"projection_type", "fisheye"}};
}

TEST(GoogleModels, ProjectAsOpenCvDoes) {
  const ForeignRig foreign = parse("google", {json{google_camera("camera_0001")}.dump()});
  EXPECT_FALSE(foreign.arbitrary_scale);
  const rig::Rig rig = rig::rig_from_document(document_of(foreign));
  const Eigen::Vector3d turn(0.3, -1.2, 0.4);
  const Eigen::Matrix3d rotation =
      Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  const Eigen::Vector3d position(0.1, -0.2, 0.3);
  for (const Eigen::Vector3d& in_camera :
       {Eigen::Vector3d(0.2, 0.1, 1), Eigen::Vector3d(-3, 2, 1), Eigen::Vector3d(1, 1, -0.2)}) {
    const Eigen::Vector3d in_world = rotation.transpose() * in_camera + position;
    const double across = in_camera.head<2>().norm();
    const double theta = std::atan2(across, in_camera.z()), s = theta * theta;
    const double theta_d = theta * (1 + 0.01 * s - 0.002 * s * s);
    const Eigen::Vector2d expected =
        20.5 * theta_d / across * in_camera.head<2>() + Eigen::Vector2d(31.5, 25);
    const auto& camera = rig.cameras[0];
    const auto pixel = camera.model.project(camera.pose.camera_from_world(in_world));
    ASSERT_TRUE(pixel);
    EXPECT_LT((*pixel - expected).norm(), 1e-9);
  }
}

TEST(GoogleModels, AreWrittenAndReadWithoutLoss) {
  schemas::RigDocument rig = rig_of_fisheyes(Projection::kFisheye);
  rig.cameras[1].geometry.intrinsics.radial_distortion[3] = 1e-6;
  expect_same(rewritten("google", rig), rig);
  rig.cameras[2].geometry.intrinsics.fy += 1;
  EXPECT_THAT(export_refusal("google", rig),
              AllOf(HasSubstr("camera \"c20\""), HasSubstr("one focal length")));
  EXPECT_THAT(export_refusal("google", rig_of_fisheyes(Projection::kOrthographic)),
              AllOf(HasSubstr("camera \"c0\""), HasSubstr("orthographic lens")));
}

TEST(GoogleModels, BadModelsAreRefusedAtThePlace) {
  struct Case {
    const char* pointer;
    json value;
    const char* message;
  };
  for (const Case& c : std::initializer_list<Case>{
           {"/1/name", "../x", "models.json#/1/name: found \"../x\""},
           {"/1/name", "camera_0001",
            "models.json#/1/name: the name \"camera_0001\" is used twice"},
           {"/1/width", 0, "models.json#/1/width: found 0"},
           {"/1/height", 1e6, "models.json#/1/height: found 1000000"},
           {"/1/focal_length", -1, "models.json#/1/focal_length: found -1"},
           {"/1/focal_length", {1, 1}, "models.json#/1/focal_length: found an array"},
           {"/1/pixel_aspect_ratio", 2, "models.json#/1/pixel_aspect_ratio: found 2"},
           {"/1/radial_distortion", {1, 2, 3, 4, 5}, "#/1/radial_distortion: found an array of 5"},
           {"/1/orientation", {1, 2}, "models.json#/1/orientation: found an array of 2"},
           {"/1/orientation", {1, 2, nullptr}, "models.json#/1/orientation/2: found null"},
           {"/1/projection_type", "spherical", "#/1/projection_type: found \"spherical\""}}) {
    json document = {google_camera("camera_0001"), google_camera("camera_0002")};
    document[json::json_pointer(c.pointer)] = c.value;
    EXPECT_THAT(refusal("google", {document.dump()}), HasSubstr(c.message)) << c.pointer;
  }
  EXPECT_THAT(refusal("google", {"[]"}), HasSubstr("models.json"));
  EXPECT_THAT(refusal("google", {"[NaN]"}), HasSubstr("models.json:1"));
}

// --- COLMAP ---

constexpr const char* kImages = "1 1 0 0 0 0 0 0 7 a.jpg\n\n";

schemas::Intrinsics colmap_lens(const std::string& camera) {
  return parse("colmap", {"7 " + camera + "\n", kImages}).cameras.at(0).geometry.intrinsics;
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
      refusal("colmap",
              {"7 THIN_PRISM_FISHEYE 48 40 50 51 24 20 0.1 0.2 0 0 0.3 0.4 1e-3 0\n", kImages}),
      AllOf(HasSubstr("cameras.txt:1"), HasSubstr("THIN_PRISM_FISHEYE"), HasSubstr("sx1")));
  EXPECT_THAT(refusal("colmap", {"7 RAD_TAN_THIN_PRISM_FISHEYE 48 40 50\n", kImages}),
              AllOf(HasSubstr("cameras.txt:1"), HasSubstr("RAD_TAN_THIN_PRISM_FISHEYE")));
}

/// Returns the largest distance of the pixels of one ray by the FOV model and by ours, over the
/// picture.
double fov_error(double f, double omega, int width, int height) {
  const ForeignRig foreign =
      parse("colmap", {fmt::format("7 FOV {} {} {} {} {} {} {}\n", width, height, f, f, width / 2.0,
                                   height / 2.0, omega),
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
  EXPECT_THAT(refusal("colmap", {"7 FOV 4000 4000 1000 1000 2000 2000 2.2\n", kImages}),
              AllOf(HasSubstr("cameras.txt:1"), HasSubstr("FOV"), HasSubstr("corners")));
  EXPECT_THAT(refusal("colmap", {"7 FOV 3000 2000 1000 1000 1500 1000 1.2\n", kImages}),
              AllOf(HasSubstr("cameras.txt:1"), HasSubstr("FOV"), HasSubstr("px off")));
  EXPECT_THAT(refusal("colmap", {"7 FOV 48 40 50 51 24 20 3.2\n", kImages}), HasSubstr("omega"));
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

// --- NeRF ---

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
  const ForeignRig rig = parse("nerf", {document.dump()});
  schemas::Intrinsics lens{20, 21, 32, 24, {}, Projection::kFisheye};
  lens.radial_distortion = {0.1, 0.3, 0, -0.2};
  EXPECT_EQ(rig.cameras.at(0).geometry.intrinsics, lens);
  document["p1"] = 0.1;
  EXPECT_THAT(refusal("nerf", {document.dump()}),
              HasSubstr("transforms.json#/frames/0: found \"p1\" 0.1"));
  document.erase("p1");
  document.erase("w");
  EXPECT_THAT(refusal("nerf", {document.dump()}), HasSubstr("\"w\" and \"h\""));
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
  EXPECT_EQ(detect_rig_format({false, {"cameras"}})->name(), "facebook360");
  EXPECT_EQ(detect_rig_format({false, {"frames", "cameras"}})->name(), "nerf");
  EXPECT_EQ(detect_rig_format({false, {"schema", "cameras"}}), nullptr);
  EXPECT_EQ(detect_rig_format({true, {}}), nullptr);
}

}  // namespace
}  // namespace raystage::ingest::rig_formats_test
