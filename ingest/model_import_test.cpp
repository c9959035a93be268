// SPDX-License-Identifier: Apache-2.0
// Tests the import of COLMAP and NeRF models, and the detection of formats.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <Eigen/Geometry>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/contained_path.h"
#include "base/error.h"
#include "ingest/import_source.h"
#include "ingest/import_take.h"
#include "ingest/rig_formats/camera_ids.h"
#include "rig/pose.h"
#include "store/take.h"
#include "testing/ingest/import_test_data.h"
#include "testing/test_folder.h"

namespace raystage::ingest {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(CameraIds, AreSafeAndUnique) {
  const std::vector<std::string> names{"a/1.jpg", "b/1.jpg", "2.png", "2.jpg",      "2.tif",
                                       "é ü.jpg", ".x",      "..",    "./train/r_0"};
  const auto ids = make_camera_ids(names);
  EXPECT_THAT(ids, ElementsAre("a_1", "b_1", "2", "2-2", "2-3", "_____", "_.x", "_..", "r_0"));
}

class Model : public ::testing::Test {
 protected:
  void write(const std::string& file, std::string_view text) const {
    create_folder((folder_.path() / file).parent_path());
    write_file_atomically(folder_.path() / file, text);
  }
  void write_jpeg(const std::string& file) const {
    write(file, testing::jpeg_as_string(testing::picture(48, 40, 1)));
  }
  ImportSource open(const std::string& path, const ModelImportOptions& options = {}) const {
    return open_import_source(folder_.path() / path, options);
  }
  std::string refusal(const std::string& path, const ModelImportOptions& options = {}) const {
    try {
      open(path, options);
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      EXPECT_FALSE(error.what_to_do().empty());
      return error.what();
    }
    return "accepted";
  }
  testing::TestFolder folder_;
};

/// Returns the pixel of a point. The camera looks along -z with y up; image y is down.
Eigen::Vector2d pixel_by_ours(const schemas::CameraGeometry& camera,
                              const Eigen::Vector3d& x_in_world) {
  const Eigen::Vector3d p =
      rig::pose_from_matrix(camera.world_from_camera).camera_from_world(x_in_world);
  const schemas::Intrinsics& k = camera.intrinsics;
  return {k.fx * p.x() / -p.z() + k.cx, k.fy * -p.y() / -p.z() + k.cy};
}

class Colmap : public Model {
 protected:
  void write_model(const std::string& folder, std::string_view cameras,
                   std::string_view images) const {
    write(folder + "/cameras.txt", cameras);
    write(folder + "/images.txt", images);
  }
};

constexpr std::string_view kPinhole = "# cameras\n7 PINHOLE 48 40 50 51 24 20\n";

TEST_F(Colmap, ProjectsAsColmapDoes) {
  write_jpeg("images/a.jpg");
  EXPECT_TRUE(rc::check("pixels by COLMAP and by us", [&] {
    const auto number = [](int low, int high) { return *rc::gen::inRange(low, high) / 100.0; };
    const Eigen::Quaterniond q(number(-100, 100), number(-100, 100), number(-100, 100),
                               number(-100, 100));
    RC_PRE(q.norm() > 0.1);
    const Eigen::Vector3d t(number(-100, 100), number(-100, 100), number(-100, 100));
    write_model("sparse", kPinhole,
                fmt::format("1 {} {} {} {} {} {} {} 7 a.jpg\n\n", q.w(), q.x(), q.y(), q.z(), t.x(),
                            t.y(), t.z()));
    const schemas::ImportManifest manifest = open("sparse").manifest;
    // A point in front of the camera. COLMAP: x_camera = R x_world + t, +z forward, y down.
    const Eigen::Vector3d x_in_camera(number(-50, 50), number(-50, 50), number(50, 300));
    const Eigen::Vector3d x_in_world = q.normalized().inverse() * (x_in_camera - t);
    const Eigen::Vector2d expected(50 * x_in_camera.x() / x_in_camera.z() + 24,
                                   51 * x_in_camera.y() / x_in_camera.z() + 20);
    RC_ASSERT((pixel_by_ours(manifest.cameras.at(0).geometry, x_in_world) - expected).norm() <
              1e-9);
  }));
}

TEST_F(Colmap, ReadsEveryCameraModel) {
  write_model("m",
              "1 SIMPLE_PINHOLE 48 40 50 24 20\n"
              "2 PINHOLE 48 40 50 51 24 20\n"
              "3 SIMPLE_RADIAL 48 40 50 24 20 0.1\n"
              "4 RADIAL 48 40 50 24 20 0.1 0.2\r\n"
              "5 OPENCV 48 40 50 51 24 20 0.1 0.2 0.3 0.4\n",
              "# remark\n"
              "9 1 0 0 0 0 0 0 5 e.jpg\n1.5 2.5 -1\n"
              "8 1 0 0 0 0 0 0 4 d.jpg\n\n"
              "7 1 0 0 0 0 0 0 3 c.jpg\n#\n"
              "6 1 0 0 0 0 0 0 2 b b.jpg \n\n"
              "5 1 0 0 0 0 0 0 1 a.jpg\n");
  for (const char* name : {"a", "b b", "c", "d", "e"}) {
    write_jpeg(fmt::format("m/images/{}.jpg", name));
  }
  const ImportSource source = open(
      "m/cameras.txt", {.images = {}, .epoch_utc = 77, .nominal_fps = 12, .has_pictures = true});
  const schemas::ImportManifest& manifest = source.manifest;
  EXPECT_EQ(manifest.name, "m");
  EXPECT_EQ(manifest.epoch_utc, 77);
  EXPECT_EQ(manifest.nominal_fps, 12);
  EXPECT_TRUE(manifest.arbitrary_scale);
  ASSERT_EQ(manifest.cameras.size(), 5u);
  const auto& cameras = manifest.cameras;
  EXPECT_EQ(cameras[1].geometry.id, "b_b");
  EXPECT_EQ(cameras[0].geometry.intrinsics, (schemas::Intrinsics{50, 50, 24, 20, {}}));
  EXPECT_EQ(cameras[1].geometry.intrinsics, (schemas::Intrinsics{50, 51, 24, 20, {}}));
  EXPECT_EQ(cameras[2].geometry.intrinsics, (schemas::Intrinsics{50, 50, 24, 20, {.k1 = 0.1}}));
  EXPECT_EQ(cameras[3].geometry.intrinsics,
            (schemas::Intrinsics{50, 50, 24, 20, {.k1 = 0.1, .k2 = 0.2}}));
  EXPECT_EQ(cameras[4].geometry.intrinsics,
            (schemas::Intrinsics{50, 51, 24, 20, {.k1 = 0.1, .k2 = 0.2, .p1 = 0.3, .p2 = 0.4}}));
  const ImportSummary summary = import_take(manifest, source.base, folder_.path() / "take", {});
  EXPECT_EQ(summary.copied, 5);
  EXPECT_EQ(store::Take(folder_.path() / "take").document().cameras[4].id, "e");
}

TEST_F(Colmap, FindsItsImages) {
  constexpr std::string_view kImages = "1 1 0 0 0 0 0 0 7 sub/a.jpg\n\n";
  for (const char* place :
       {"p/images", "p/sparse/images", "p/sparse/0/images", "p/sparse/0", "x"}) {
    std::filesystem::remove_all(folder_.path() / "p");
    write_model("p/sparse/0", kPinhole, kImages);
    EXPECT_THAT(refusal("p"), AllOf(HasSubstr("sub/a.jpg"), HasSubstr("folder of the images")));
    write_jpeg(fmt::format("{}/sub/a.jpg", place));
    ModelImportOptions options;
    if (std::string_view(place) == "x") options.images = folder_.path() / "x";
    const ImportSource source = open("p", options);
    EXPECT_TRUE(std::filesystem::equivalent(source.base / source.manifest.cameras[0].frames[0].file,
                                            folder_.path() / place / "sub" / "a.jpg"));
  }
}

TEST_F(Colmap, NamesDoNotLeaveTheFolderOfTheImages) {
  write_jpeg("secret.jpg");
  write_model("m/sparse", kPinhole, "1 1 0 0 0 0 0 0 7 ../secret.jpg\n\n");
  EXPECT_THAT(refusal("m"), AllOf(HasSubstr("images.txt:1"), HasSubstr("leaves the folder")));
  write_model("m/sparse", kPinhole,
              "1 1 0 0 0 0 0 0 7 " + (folder_.path() / "secret.jpg").string() + "\n\n");
  EXPECT_THAT(refusal("m"), AllOf(HasSubstr("images.txt:1"), HasSubstr("leaves the folder")));
}

TEST_F(Colmap, BadModelsAreRefusedByLine) {
  write_jpeg("m/a.jpg");
  constexpr std::string_view kImages = "1 1 0 0 0 0 0 0 7 a.jpg\n\n";
  struct Case {
    std::string_view cameras, images;
    const char* message;
  };
  for (const Case& c :
       {Case{"\n7 FULL_OPENCV 48 40 1 1 1 1 0 0 0 0 0 0.1 0 0\n", kImages, "cameras.txt:2"},
        Case{"7 FISHEYE 1 1 1\n", kImages, "FISHEYE is not supported"},
        Case{"7 PINHOLE 48 40 50 51 24\n", kImages, "camera parameter is missing"},
        Case{"7 PINHOLE 48 40 50 51 24 20 1\n", kImages, "more parameters than PINHOLE has"},
        Case{"7 PINHOLE 48 40 nan 51 24 20\n", kImages, "found \"nan\""},
        Case{"7 PINHOLE 48 40 50x 51 24 20\n", kImages, "found \"50x\""},
        Case{"7 PINHOLE 48 40 1e999 51 24 20\n", kImages, "a finite number"},
        Case{"7 PINHOLE 48 40 -50 51 24 20\n", kImages, "must be greater than 0"},
        Case{"7 PINHOLE 0 40 50 51 24 20\n", kImages, "0x40"},
        Case{"7 PINHOLE 48 40 50 51 24 20\n7 PINHOLE 48 40 50 51 24 20\n", kImages,
             "is used twice"},
        Case{"8 PINHOLE 48 40 50 51 24 20\n", kImages, "camera 7 is not in cameras.txt"},
        Case{kPinhole, "1 0 0 0 0 0 0 0 7 a.jpg\n\n", "images.txt:1: the quaternion has length 0"},
        Case{kPinhole, "1 1 0 0 0 0 0 7\n\n", "images.txt:1"},
        Case{kPinhole, "1 1 0 0 0 0 0 0 7\n\n", "name is missing"},
        Case{kPinhole, "# nothing\n", "no registered image"}}) {
    write_model("m", c.cameras, c.images);
    EXPECT_THAT(refusal("m"), HasSubstr(c.message));
  }
}

TEST_F(Colmap, BinaryModelsAreRefusedWithAdvice) {
  write("m/sparse/0/cameras.bin", "x");
  EXPECT_THAT(refusal("m"), HasSubstr("model_converter"));
  EXPECT_THAT(refusal("m/sparse/0/cameras.bin"), HasSubstr("model_converter"));
}

class Nerf : public Model {
 protected:
  Nerf() {
    write_jpeg("train/r_0.jpg");
    write_jpeg("train/r_1.jpg");
    for (const char* path : {"./train/r_0", "train/r_1.jpg"}) {
      document_["frames"].push_back(
          {{"file_path", path},
           {"transform_matrix", {{1, 0, 0, 1}, {0, 0, -1, 2}, {0, 1, 0, 3}, {0, 0, 0, 1}}}});
    }
    document_["camera_angle_x"] = std::numbers::pi / 2;
  }
  schemas::ImportManifest read(const ModelImportOptions& options = {}) const {
    write("transforms.json", document_.dump());
    return open("transforms.json", options).manifest;
  }
  std::string refused() const {
    write("transforms.json", document_.dump());
    return refusal("transforms.json");
  }
  json document_;
};

TEST_F(Nerf, ReadsTheOriginalForm) {
  const schemas::ImportManifest manifest = read();
  ASSERT_EQ(manifest.cameras.size(), 2u);
  const schemas::CameraGeometry& camera = manifest.cameras[0].geometry;
  EXPECT_EQ(camera.id, "r_0");
  EXPECT_EQ(camera.width, 48);
  EXPECT_EQ(camera.height, 40);
  EXPECT_NEAR(camera.intrinsics.fx, 24, 1e-12);
  EXPECT_NEAR(camera.intrinsics.fy, 24, 1e-12);
  EXPECT_EQ(camera.intrinsics.cx, 24);
  EXPECT_EQ(camera.intrinsics.cy, 20);
  const rig::Pose pose = rig::pose_from_matrix(camera.world_from_camera);
  EXPECT_NEAR((pose.position - Eigen::Vector3d(1, 2, 3)).norm(), 0, 1e-15);
  EXPECT_NEAR((pose.viewing_direction() - Eigen::Vector3d(0, 1, 0)).norm(), 0, 1e-15);
  const ImportSource source = open("transforms.json");
  EXPECT_EQ(import_take(source.manifest, source.base, folder_.path() / "take", {}).copied, 2);
}

TEST_F(Nerf, FramesOverrideTheWhole) {
  document_.update({{"fl_x", 30}, {"fl_y", 31}, {"cx", 23}, {"cy", 19}, {"w", 48}, {"h", 40}});
  document_.update({{"k1", 0.1}, {"k2", 0.2}, {"p1", 0.3}, {"p2", 0.4}, {"k3", 0.5}});
  document_["camera_model"] = "OPENCV";
  document_["aabb_scale"] = 16;
  document_["frames"][1].update({{"fl_x", 40}, {"k1", 0}});
  const schemas::ImportManifest manifest = read();
  EXPECT_EQ(manifest.cameras[0].geometry.intrinsics,
            (schemas::Intrinsics{30, 31, 23, 19, {0.1, 0.2, 0.3, 0.4, 0.5}}));
  EXPECT_EQ(manifest.cameras[1].geometry.intrinsics,
            (schemas::Intrinsics{40, 31, 23, 19, {0, 0.2, 0.3, 0.4, 0.5}}));
}

TEST_F(Nerf, AUniformScaleIsRemoved) {
  document_["frames"][0]["transform_matrix"] = {{0, -3, 0, 1}, {3, 0, 0, 2}, {0, 0, 3, 3}};
  const rig::Pose pose = rig::pose_from_matrix(read().cameras[0].geometry.world_from_camera);
  EXPECT_NEAR(pose.world_from_camera_rotation(1, 0), 1, 1e-12);
  EXPECT_NEAR(pose.position.y(), 2, 1e-15);
}

TEST_F(Nerf, ImagesMayBeElsewhere) {
  write_jpeg("other/train/r_0.jpg");
  write_jpeg("other/train/r_1.jpg");
  const auto manifest = read({.images = folder_.path() / "other"});
  EXPECT_THAT(manifest.cameras[0].frames[0].file, HasSubstr("other"));
}

TEST_F(Nerf, NamesAndLinksDoNotLeaveTheFolderOfTheImages) {
  write_jpeg("secret.jpg");
  write_jpeg("model/images/inside.jpg");
  std::filesystem::create_symlink("../../secret.jpg", folder_.path() / "model/images/link.jpg");
  std::filesystem::create_directory_symlink("..", folder_.path() / "model/up");
  const std::string absolute = (folder_.path() / "secret.jpg").string();
  document_.update({{"w", 48}, {"h", 40}});  // so that no picture is decoded
  const auto import = [&](const std::string& name) {
    document_["frames"][1]["file_path"] = name;
    document_["frames"][0]["file_path"] = "./images/inside";
    write("model/transforms.json", document_.dump());
    return refusal("model/transforms.json");
  };
  for (const std::string& name : {std::string("../secret.jpg"), std::string("images/../../secret"),
                                  absolute, absolute.substr(0, absolute.size() - 4)}) {
    EXPECT_THAT(import(name), AllOf(HasSubstr("#/frames/1/file_path"), HasSubstr("leaves"),
                                    HasSubstr("images/0001.jpg")))
        << name;
  }
  EXPECT_THAT(import("images/link.jpg"), HasSubstr("is a link"));
  EXPECT_THAT(import("up/secret"), HasSubstr("is a link"));
  for (const char* name : {"./images/inside", "images/inside.jpg", "images/../images/inside.jpg"}) {
    EXPECT_EQ(import(name), "accepted") << name;
  }
  ::setenv(kFollowLinksVariable, "1", 1);
  for (const std::string& name : {std::string("../secret"), absolute, std::string("up/secret"),
                                  std::string("images/link.jpg")}) {
    EXPECT_EQ(import(name), "accepted") << name;
  }
  ::unsetenv(kFollowLinksVariable);
}

TEST_F(Nerf, BadModelsAreRefusedAtThePlace) {
  struct Case {
    const char* pointer;
    json value;
    const char* message;
  };
  const json whole = document_;
  for (const Case& c : std::initializer_list<Case>{
           {"/frames", json::array(), "#/frames: found an array of 0"},
           {"/frames/1/file_path", "train/r_9", "#/frames/1/file_path: the image \"train/r_9\""},
           {"/frames/1/file_path", 9, "#/frames/1/file_path: found 9"},
           {"/frames/1/transform_matrix", {{1}}, "#/frames/1/transform_matrix: found"},
           {"/frames/1/transform_matrix",
            {{-1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}},
            "#/frames/1/transform_matrix: the matrix mirrors"},
           {"/frames/1/transform_matrix",
            {{1, 0, 0, 0}, {0, 1.1, 0, 0}, {0, 0, 1, 0}},
            "#/frames/1/transform_matrix: the matrix is skewed"},
           {"/camera_angle_x", 0, "#/camera_angle_x: found 0"},
           {"/camera_angle_x", 4, "#/camera_angle_x: found 4"},
           {"/frames/1/fl_x", -1, "#/frames/1/fl_x: found -1"},
           {"/camera_model", "EQUIRECTANGULAR", "#/camera_model: found \"EQUIRECTANGULAR\""},
           {"/camera_model", "OPENCV_FISHEYE", "#/frames/0: a fisheye needs \"fl_x\""},
           {"/is_fisheye", true, "#/frames/0: a fisheye needs \"fl_x\""},
           {"/k4", 0.1, "#/frames/0: found \"k4\" 0.1"}}) {
    document_ = whole;
    document_[json::json_pointer(c.pointer)] = c.value;
    EXPECT_THAT(refused(), HasSubstr(c.message));
  }
  document_ = whole;
  document_.erase("camera_angle_x");
  EXPECT_THAT(refused(), HasSubstr("#/frames/0: neither \"fl_x\""));
}

class ImportSources : public Model {};

TEST_F(ImportSources, AreToldByTheirContents) {
  const schemas::ImportManifest manifest = testing::write_two_cameras(folder_.path());
  schemas::write_import_manifest(manifest, folder_.path() / "anything.txt");
  EXPECT_EQ(open("anything.txt").manifest.name, "test");
  EXPECT_EQ(open("anything.txt").base, folder_.path());
  EXPECT_THAT(refusal("anything.txt", {.images = "x"}), HasSubstr("folder of images"));
  schemas::write_import_manifest(manifest, folder_.path() / "import.json");
  EXPECT_EQ(open("").manifest.name, "test");
}

TEST_F(ImportSources, OthersAreRefused) {
  struct Case {
    const char *text, *message;
  };
  for (const Case& c :
       {Case{"", "the format of this file is not supported"},
        Case{"hello", "the format of this file"}, Case{"[1]", "the format of this file"},
        Case{"{}", "neither \"schema\" nor"}, Case{"{\"a\": }", "f.json:1:7"},
        Case{"{\"schema\": \"raystage/rig/1\"}", "#/schema: found"},
        Case{"{\"schema\": \"raystage/import/9\"}", "version 9"}}) {
    write("f.json", c.text);
    EXPECT_THAT(refusal("f.json"), HasSubstr(c.message)) << c.text;
  }
  EXPECT_THAT(refusal("f.json"), Not(HasSubstr("one of these")));
  write("f.json", "{}");
  EXPECT_THAT(refusal("f.json"),
              AllOf(HasSubstr("Choose one of these: import manifest"),
                    HasSubstr("; or rig.json of facebook360_dep and Surround360.")));
  write("sub/readme.txt", "x");
  EXPECT_THAT(refusal("sub"), HasSubstr("the folder has no supported"));
  EXPECT_THAT(refusal("none.json"), HasSubstr("No such file"));
}

}  // namespace
}  // namespace raystage::ingest
