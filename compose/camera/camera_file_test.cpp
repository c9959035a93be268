// SPDX-License-Identifier: Apache-2.0
// Camera files of other programs: round trips, and the frames, lenses and film backs they leave
// open.
#include "compose/camera/camera_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "base/atomic_file.h"
#include "base/error.h"
#include "compose/camera/camera_export.h"
#include "compose/camera/chan_file.h"
#include "compose/camera/gltf_camera.h"
#include "compose/camera/shot_camera.h"
#include "testing/test_folder.h"

namespace raystage::compose {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector2d;
using Eigen::Vector3d;
using schemas::ShotDocument;
using ::testing::HasSubstr;

class CameraFiles : public ::testing::Test {
 protected:
  /// A crane shot with a zoom at a rate of film, numbered as studios do.
  CameraFiles() {
    shot_.width = 1920;
    shot_.height = 1080;
    shot_.fps_numerator = 24000;
    shot_.fps_denominator = 1001;
    shot_.fps = 24000 / 1001.0;
    shot_.first_frame = 1001;
    shot_.last_frame = 1048;
    shot_.camera.film_back_mm = 24.89;
    shot_.camera.keys = {{.frame = 1001,
                          .position = {{-1.5, 1, 4}},
                          .focal_length_mm = 32,
                          .target = {{0, 1, -4}},
                          .roll_deg = 0,
                          .focus_m = 8,
                          .f_number = 2.8},
                         {.frame = 1030, .position = {{1, 3.2, 3}}, .focal_length_mm = 85},
                         {.frame = 1048, .position = {{2, 1, 2}}, .roll_deg = -15, .focus_m = 6}};
    for (int frame = shot_.first_frame; frame <= shot_.last_frame; ++frame) {
      frames_.push_back(frame);
    }
  }

  ShotCamera camera() const { return {shot_, folder_.path() / "shot.json"}; }
  void write(const std::string& name, std::string_view text) const {
    write_file_atomically(folder_.path() / name, text);
  }
  /// Writes the camera to a file, and makes the shot use it.
  void export_and_use(const std::string& name) {
    const ShotCamera original = camera();
    write(name, format_camera_file({original, shot_, frames_}, folder_.path() / name));
    use(name);
  }
  void use(const std::string& name) {
    shot_.camera.keys.clear();
    shot_.camera.file = ShotDocument::CameraFile{.path = name};
  }
  std::string refusal() const {
    try {
      camera();
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      return error.what();
    }
    return "none";
  }
  /// Returns the text of a glTF camera with a key at each of the frames of a rate, as Blender
  /// writes it: it moves by 1 m per frame along x.
  static nlohmann::json exported(double fps, int first, int count) {
    std::vector<GltfCameraKey> keys(count);
    for (int i = 0; i < count; ++i) {
      keys[i].seconds = (first + i) / fps;
      keys[i].pose.position.x() = first + i;
    }
    nlohmann::json document =
        nlohmann::json::parse(format_gltf_camera("c", 16.0 / 9, keys, {24, 1}, 0));
    document["asset"].erase("extras");
    return document;
  }

  ShotDocument shot_;
  std::vector<int> frames_;
  testing::TestFolder folder_;
};

Vector2d image_of(const render::VirtualCamera& view, const Vector3d& point) {
  const Vector3d x = view.pose.camera_from_world(point);
  const schemas::Intrinsics& k = view.intrinsics;
  return {k.cx + k.fx * x.x() / -x.z(), k.cy - k.fy * x.y() / -x.z()};
}

/// Returns the largest distance between images of points that fill the picture of `a`, in pixels.
double pixels_between(const render::VirtualCamera& a, const render::VirtualCamera& b) {
  double worst = 0;
  for (const double distance : {1.0, 5.0, 100.0}) {
    for (const double x : {-0.98, 0.0, 0.98}) {
      for (const double y : {-0.98, 0.0, 0.98}) {
        const Vector3d direction(x * a.width / 2 / a.intrinsics.fx,
                                 y * a.height / 2 / a.intrinsics.fy, -1);
        const Vector3d point = a.pose.world_from_camera(direction * distance);
        worst = std::max(worst, (image_of(a, point) - image_of(b, point)).norm());
      }
    }
  }
  return worst;
}

TEST_F(CameraFiles, ChanHasTheSamePicturesAtEveryFrame) {
  const ShotCamera original = camera();
  export_and_use("move.chan");
  const ShotCamera again = camera();
  for (const int frame : frames_) {
    EXPECT_LT(pixels_between(original.camera(frame), again.camera(frame)), 1e-3) << frame;
  }
  EXPECT_THAT(again.file_summary(), HasSubstr("move.chan, frames 1001 to 1048, vertical field of "
                                              "view of a film back of 24.89 x 14.0006 mm"));
}

TEST_F(CameraFiles, GltfHasTheSamePicturesAtEveryFrame) {
  const ShotCamera original = camera();
  export_and_use("move.gltf");
  const ShotCamera again = camera();
  for (const int frame : frames_) {
    EXPECT_LT(pixels_between(original.camera(frame), again.camera(frame)), 1e-2) << frame;
  }
  EXPECT_THAT(again.file_summary(), HasSubstr("frames 1001 to 1048 at 23.97602398 fps"));
}

/// The knobs of a Nuke node: for each name its values, and those of a curve by frame.
class NukeNode {
 public:
  explicit NukeNode(const std::string& script) {
    std::istringstream lines(script);
    std::string line;
    std::getline(lines, line);
    EXPECT_EQ(line, "Camera2 {");
    while (std::getline(lines, line) && line != "}") {
      std::istringstream words(line);
      std::string name, rest;
      words >> name;
      std::getline(words, rest);
      knobs_[name] = rest;
    }
    EXPECT_EQ(line, "}");
  }
  const std::string& text(const std::string& name) const { return knobs_.at(name); }
  /// Returns one of the values of a knob at a frame.
  double value(const std::string& name, int frame, int index = 0) const {
    std::string text = knobs_.at(name);
    std::ranges::replace(text, '{', ' ');
    std::vector<std::string> curves;
    for (std::istringstream parts(text); std::getline(parts, text, '}');) {
      if (text.find("curve") != std::string::npos) curves.push_back(text);
    }
    std::istringstream words(curves.empty() ? knobs_.at(name) : curves.at(index));
    for (std::string word; words >> word;) {
      if (word != "x" + std::to_string(frame)) continue;
      double value = 0;
      words >> value;
      return value;
    }
    return std::stod(knobs_.at(name));
  }

 private:
  std::map<std::string, std::string> knobs_;
};

TEST_F(CameraFiles, ANukeCameraHasTheSamePicturesAtEveryFrame) {
  shot_.camera.stereo = ShotDocument::Stereo{.interaxial_m = 0.065, .convergence_m = 5};
  shot_.camera.keys.front().shift_x = shot_.camera.keys.front().shift_y = 0;
  shot_.camera.keys.back().shift_x = 0.1;
  shot_.camera.keys.back().shift_y = -0.25;
  const ShotCamera original = camera();
  const NukeNode node(
      format_camera_file({original, shot_, frames_, Eye::kRight}, folder_.path() / "a.nk"));
  EXPECT_EQ(node.text("rot_order"), " ZXY");
  for (const int frame : frames_) {
    const auto vector = [&](const std::string& name) {
      return Vector3d(node.value(name, frame, 0), node.value(name, frame, 1),
                      node.value(name, frame, 2));
    };
    // Nuke: the film back's width spans the picture; win_translate moves it by half widths.
    render::VirtualCamera view = original.camera(frame, Eye::kRight);
    const render::VirtualCamera expected = view;
    const double haperture = std::stod(node.text("haperture"));
    view.intrinsics.fx = view.intrinsics.fy = node.value("focal", frame) / haperture * view.width;
    view.intrinsics.cx = view.width / 2.0 * (1 - node.value("win_translate", frame, 0));
    view.intrinsics.cy = (view.height + view.width * node.value("win_translate", frame, 1)) / 2;
    view.pose.position = vector("translate");
    view.pose.world_from_camera_rotation =
        rotation_from_angles(vector("rotate") * std::numbers::pi / 180, RotationOrder::kZxy)
            .toRotationMatrix();
    EXPECT_LT(pixels_between(expected, view), 1e-3) << frame;
    EXPECT_NEAR(node.value("focal_point", frame), *original.state(frame).focus_m, 1e-12);
  }
  EXPECT_EQ(node.value("fstop", 1001), 2.8);
  EXPECT_NEAR(std::stod(node.text("vaperture")), 24.89 * 9 / 16, 1e-9);
}

TEST_F(CameraFiles, ATimeOfGltfIsItsFrameWhereverTheShotBegins) {
  shot_.fps = shot_.fps_numerator = 24;
  shot_.fps_denominator = 1;
  write("blender.gltf", exported(24, 1, 1100).dump());
  use("blender.gltf");
  EXPECT_NEAR(camera().state(1010).pose.position.x(), 1010, 1e-3);
  shot_.first_frame = 1005;  // a shorter shot shows the same
  EXPECT_NEAR(camera().state(1010).pose.position.x(), 1010, 1e-3);
  shot_.camera.file->frame_offset = 3;
  EXPECT_NEAR(camera().state(1010).pose.position.x(), 1007, 1e-3);
}

TEST_F(CameraFiles, AnotherRateIsNoticedAndCanBeStated) {
  shot_.fps = shot_.fps_numerator = 30;
  shot_.fps_denominator = 1;
  write("blender.gltf", exported(24, 1001, 48).dump());
  use("blender.gltf");
  EXPECT_THAT(refusal(), HasSubstr("shot.json#/camera/file: the keys of "));
  EXPECT_THAT(refusal(), HasSubstr("are not at frames of 30 fps, the shot's rate; they are frames "
                                   "at 24 fps"));
  shot_.camera.file->fps = FrameRate{24, 1};
  EXPECT_NEAR(camera().state(1010).pose.position.x(), 1010, 1e-3);
  // A rate that the file states counts as well.
  nlohmann::json document = exported(24, 1001, 48);
  document["asset"]["extras"] = {{"fps", "24/1"}};
  write("blender.gltf", document.dump());
  shot_.camera.file->fps.reset();
  EXPECT_NEAR(camera().state(1010).pose.position.x(), 1010, 1e-3);
  // So does the frame of its first key, if a program moved the keys to time 0.
  document = exported(24, 0, 48);
  document["asset"]["extras"] = {{"fps", "24/1"}, {"first_frame", 1001}};
  write("blender.gltf", document.dump());
  EXPECT_NEAR(camera().state(1010).pose.position.x(), 9, 1e-3);
}

TEST_F(CameraFiles, BlenderIgnoresTheBaseOfItsFrameRate) {
  write("blender.gltf", exported(24, 1001, 48).dump());  // the shot has 24000/1001
  use("blender.gltf");
  EXPECT_NEAR(camera().state(1040).pose.position.x(), 1040, 1e-3);
  EXPECT_THAT(camera().file_summary(), HasSubstr("frames 1001 to 1048 at 24 fps"));
}

TEST_F(CameraFiles, TheRateOfWrittenTimesCanBeAnother) {
  const ShotCamera original = camera();
  write("move.gltf", camera_to_gltf(original, shot_, frames_, Eye::kBoth, "c", FrameRate{24, 1}));
  use("move.gltf");
  for (const int frame : frames_) {
    EXPECT_LT(pixels_between(original.camera(frame), camera().camera(frame)), 1e-2) << frame;
  }
  EXPECT_THAT(camera().file_summary(), HasSubstr("at 24 fps"));
}

TEST_F(CameraFiles, AMoveOutsideOfTheShotIsRefused) {
  write("move.chan", "1 0 0 0 0 0 0 40\n48 1 0 0 0 0 0 40\n");
  use("move.chan");
  EXPECT_THAT(refusal(),
              HasSubstr("are at frames 1 to 48, none of the shot's frames 1001 to 1048"));
  shot_.camera.file->frame_offset = 1000;
  EXPECT_EQ(refusal(), "none");
  write("move.chan", "1 0 0 0 0 0 0 40\n");  // a camera that stands still
  shot_.camera.file->frame_offset = 0;
  EXPECT_EQ(refusal(), "none");
}

TEST_F(CameraFiles, LensKeysComplementAFileWithoutAnAnimatedLens) {
  shot_.camera.keys[1].focal_length_mm.reset();  // no zoom: Blender writes the lens of one frame
  export_and_use("move.gltf");
  shot_.camera.keys = {{.frame = 1001, .focal_length_mm = 32},
                       {.frame = 1048, .focal_length_mm = 50, .focus_m = 3}};
  EXPECT_NEAR(camera().state(1048).focal_length_mm, 50, 1e-9);
  EXPECT_THAT(camera().file_summary(), HasSubstr(", lens of the keys"));

  shot_.camera.file.reset();  // the file zooms
  shot_.camera.keys[0].position = {{0, 0, 0}};
  export_and_use("zoom.gltf");
  shot_.camera.keys = {{.frame = 1001, .focal_length_mm = 32}};
  EXPECT_THAT(refusal(), HasSubstr("both the camera file and the keys give the focal length"));
}

TEST_F(CameraFiles, AFieldOfViewBelongsToItsFilmBack) {
  // Blender: 50 mm on 36 x 24 mm, whatever the picture's aspect ratio.
  const double fov = 2 * std::atan(24 / 2.0 / 50) * 180 / std::numbers::pi;
  write("blender.chan", "1001 0 0 0 0 0 0 " + std::to_string(fov) + "\n");
  use("blender.chan");
  shot_.camera.film_back_mm = 36;
  EXPECT_GT(std::abs(camera().state(1001).focal_length_mm - 50), 5);
  shot_.camera.file->film_back_height_mm = 24;
  EXPECT_NEAR(camera().state(1001).focal_length_mm, 50, 1e-4);
}

}  // namespace
}  // namespace raystage::compose
