// SPDX-License-Identifier: Apache-2.0
// Tests Google's models: formulas, round trips, damage.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "ingest/rig_formats/rig_format.h"
#include "rig/rig.h"
#include "testing/ingest/rig_format_test_data.h"

namespace raystage::ingest::google_models_test {
namespace {

using nlohmann::json;
using schemas::Projection;
using ::testing::AllOf;
using testing::document_of;
using testing::expect_same;
using testing::export_refusal;
using ::testing::HasSubstr;
using testing::parse_rig_files;
using testing::rewritten;
using testing::rig_of_fisheyes;
using testing::rig_refusal;

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
  const ForeignRig foreign = parse_rig_files("google", {json{google_camera("camera_0001")}.dump()});
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

// The example in the readme of the data set (augmentedperception/deepview_video_dataset), with its
// result. The sizes are floating-point numbers there, too.
TEST(GoogleModels, ProjectAsTheirReadmeDoes) {
  const json camera = {
      {"name", "camera_0001"},
      {"position", {0.003311238794086777, 0.000126384684934784, 0.42421246053630285}},
      {"orientation", {-0.03295944563072383, 0.02964606619481096, -0.03337751007195316}},
      {"focal_length", 1111.3638715594666},
      {"pixel_aspect_ratio", 1.0},
      {"principal_point", {1284.7296468363463, 925.4651609728676}},
      {"height", 1920.0},
      {"width", 2560.0},
      {"radial_distortion", {0.0970525284520715, -0.01708587111009977, 0.0}},
      {"projection_type", "fisheye"}};
  const rig::Rig rig =
      rig::rig_from_document(document_of(parse_rig_files("google", {json{camera}.dump()})));
  const rig::Rig::Camera& read = rig.cameras[0];
  const auto pixel = read.model.project(read.pose.camera_from_world({0.5, 0.5, 10}));
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x(), 1377.85525, 1e-5);
  EXPECT_NEAR(pixel->y(), 1017.61440, 1e-5);
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
    EXPECT_THAT(rig_refusal("google", {document.dump()}), HasSubstr(c.message)) << c.pointer;
  }
  json incomplete = {google_camera("camera_0001")};
  incomplete[0].erase("projection_type");
  EXPECT_THAT(rig_refusal("google", {incomplete.dump()}),
              AllOf(HasSubstr("models.json#/0"), HasSubstr("projection_type")));
  EXPECT_THAT(rig_refusal("google", {"[]"}), HasSubstr("models.json"));
  EXPECT_THAT(rig_refusal("google", {"[NaN]"}), HasSubstr("models.json:1"));
}

}  // namespace
}  // namespace raystage::ingest::google_models_test
