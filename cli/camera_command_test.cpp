// SPDX-License-Identifier: Apache-2.0
// raystage camera as an artist runs it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "schemas/shot_document.h"
#include "testing/cli/test_command.h"
#include "testing/test_folder.h"

namespace raystage::cli {
namespace {

using ::testing::HasSubstr;

struct CameraCommand : ::testing::Test {
  CameraCommand() {
    shot.name = "push in";
    shot.width = 960;
    shot.height = 540;
    shot.first_frame = 11;
    shot.last_frame = 14;
    shot.camera.keys = {
        {.frame = 11, .position = {{0, 1, 2}}, .horizontal_fov_deg = 50, .target = {{0, 1, -3}}},
        {.frame = 14, .position = {{0, 1, 0.5}}}};
    schemas::ShotDocument::Layer layer;
    layer.take = "take";  // need not exist
    shot.layers.push_back(layer);
  }
  testing::CommandResult run(const std::string& arguments) const {
    schemas::write_shot(shot, folder.path() / "shot.json");
    return testing::run_raystage("camera '" + path("shot.json") + "' " + arguments);
  }
  std::string path(const char* name) const { return (folder.path() / name).string(); }

  testing::TestFolder folder;
  schemas::ShotDocument shot;
};

TEST_F(CameraCommand, WritesALineForEachFrame) {
  const testing::CommandResult result = run("-o '" + path("a.chan") + "'");
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("4 frames, 11-14"));
  EXPECT_THAT(
      result.output,
      HasSubstr(
          "film back of the importing camera to 36 x 20.25 mm and its rotation order to ZXY"));
  const std::string text = read_file(path("a.chan"));
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 4);
  EXPECT_THAT(text, ::testing::StartsWith("11\t0\t1\t2\t"));
}

TEST_F(CameraCommand, WhatItWritesIsRead) {
  for (const char* name : {"a.chan", "a.gltf"}) {
    ASSERT_EQ(run("-o '" + path(name) + "'").exit_code, 0);
    schemas::ShotDocument again = shot;
    again.camera = {};
    again.camera.file = schemas::ShotDocument::CameraFile{.path = name};
    schemas::write_shot(again, folder.path() / "again.json");
    const std::string from = std::string("camera '") + path("again.json") + "' -o '";
    EXPECT_EQ(testing::run_raystage(from + path("b.chan") + "'").exit_code, 0);
    EXPECT_THAT(read_file(path("b.chan")), HasSubstr("\n14\t0\t1\t0.5\t")) << name;
  }
}

TEST_F(CameraCommand, ZoomsAreNotWrittenToGltfWithoutAWord) {
  shot.camera.keys[1].horizontal_fov_deg = 30;
  const testing::CommandResult refused = run("-o '" + path("a.gltf") + "'");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.output, HasSubstr("cannot hold the camera's animated focal length"));
  const testing::CommandResult lossy = run("--lossy -o '" + path("a.gltf") + "'");
  EXPECT_EQ(lossy.exit_code, 0);
  EXPECT_THAT(lossy.output, HasSubstr("The animated focal length is lost."));
  EXPECT_THAT(lossy.output, HasSubstr("frame rate of the importing scene to 24 fps"));
}

TEST_F(CameraCommand, EyesAreThoseOfAStereoShot) {
  EXPECT_THAT(run("--eye left -o '" + path("a.chan") + "'").output, HasSubstr("is not stereo"));
  shot.camera.stereo = schemas::ShotDocument::Stereo{.interaxial_m = 0.1, .convergence_m = 3};
  testing::CommandResult result = run("--eye left -o '" + path("a.chan") + "'");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, HasSubstr(".chan files cannot hold the camera's lens shift"));
  EXPECT_FALSE(std::filesystem::exists(path("a.chan")));
  EXPECT_EQ(run("--eye left -o '" + path("a.nk") + "'").exit_code, 0);
  result = run("--lossy --eye left -o '" + path("a.chan") + "'");
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.output, HasSubstr("The lens shift is lost."));
  EXPECT_THAT(read_file(path("a.chan")), ::testing::StartsWith("11\t-0.05\t1\t2\t"));
}

TEST_F(CameraCommand, RefusesOtherFilesAndBrokenCameras) {
  EXPECT_EQ(run("-o '" + path("a.fbx") + "'").exit_code, 2);
  EXPECT_FALSE(std::filesystem::exists(path("a.fbx")));
  shot.camera.keys[0].position.reset();
  shot.camera.keys[1].position.reset();
  const testing::CommandResult result = run("-o '" + path("a.chan") + "'");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, HasSubstr("the camera has no position"));
}

}  // namespace
}  // namespace raystage::cli
