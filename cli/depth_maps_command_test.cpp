// SPDX-License-Identifier: Apache-2.0
// Depth maps as whole commands treat them: imported ones decide what covers what when a shot merges
// by depth, and exported ones open in programs that are not ours.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "images/exr_reader.h"
#include "images/image_file.h"
#include "rig/rig.h"
#include "schemas/shot_document.h"
#include "store/timeline.h"
#include "testing/cli/test_command.h"
#include "testing/compose/test_camera_key.h"
#include "testing/render/test_depth.h"

namespace raystage::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr int kWidth = 96, kHeight = 72;               // of the cameras, pixels
constexpr int kViewWidth = 64, kViewHeight = 48;       // of the shot, pixels
constexpr double kFovDeg = 40, kSolidDepth = 4;        // degrees, metres
const Eigen::Vector3d kViewPosition{0.02, 0.01, 0.0};  // metres

/// Returns whether a ray hits one of the bars on the front plane, which are thin and of one colour:
/// their depths are difficult to estimate.
bool hits_bar(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  constexpr double kPeriod = 0.3, kBar = 0.1;  // metres
  const double x = (from + kFront.distance(from, direction) * direction).x() / kPeriod;
  return x - std::floor(x) < kBar / kPeriod;
}
double bars_distance(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  return (hits_bar(from, direction) ? kFront : kBack).distance(from, direction);
}
std::array<double, 3> bars_scene(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  if (hits_bar(from, direction)) return {0.3, 0.35, 0.4};
  const Eigen::Vector3d hit = from + kBack.distance(from, direction) * direction;
  return texture(hit.x(), hit.y());
}

/// Bars at 2.5 m in front of a plane at 5 m, seen by 3 x 3 cameras.
class DepthMapsCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    SyntheticTake settings;
    settings.cameras = camera_grid(3, 3, 0.1, kWidth, kHeight);
    settings.depth_range = schemas::DepthRange{2.3, 6};
    settings.scene = bars_scene;
    settings.samples = 2;
    write_synthetic_take(settings, path("take"));
    const store::Take take(path("take"));
    store::write_timeline(store::build_timeline(take, 15, 0), take);
  }
  fs::path path(const std::string& name) const { return folder_.path() / name; }
  std::string quoted(const std::string& name) const { return "'" + path(name).string() + "'"; }

  /// Writes maps of all cameras: the true depths, or one depth everywhere, metres.
  void write_maps(const std::string& name, std::optional<double> depth) const {
    const store::Take take(path("take"));
    for (std::size_t i = 0; i < take.rig().cameras.size(); ++i) {
      const rig::Rig::Camera& camera = take.rig().cameras[i];
      std::vector<float> z;
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          const Eigen::Vector3d ray = camera.model.unproject({x + 0.5, y + 0.5}).value();
          const Eigen::Vector3d direction = camera.pose.world_from_camera_rotation * ray;
          z.push_back(static_cast<float>(
              depth ? *depth : bars_distance(camera.pose.position, direction) * -ray.z()));
        }
      }
      const fs::path folder = path(name) / take.document().cameras[i].id;
      create_folder(folder);
      images::write_depth_image(kWidth, kHeight, z, folder / "000001.exr");
    }
  }
  void import_maps(const std::string& name) const {
    const CommandResult imported = run_raystage("import -q --depth " + quoted("take") + " " +
                                                quoted(name) + " --depth-existing overwrite");
    ASSERT_EQ(imported.exit_code, 0) << imported.output;
  }
  /// Renders the take merged by depth with a bright solid between bars and plane. Returns the
  /// number of pixels with the wrong one of take and solid, or -1 if rendering failed.
  int wrong_pixels(const std::string& name) const {
    schemas::ShotDocument shot;
    shot.width = kViewWidth;
    shot.height = kViewHeight;
    shot.fps = shot.fps_numerator = 15;
    shot.first_frame = shot.last_frame = 1;
    shot.camera.keys.push_back(
        camera_key(1, {kViewPosition.x(), kViewPosition.y(), kViewPosition.z()}, kFovDeg));
    shot.merge = schemas::ShotDocument::Merge::kDepth;
    schemas::ShotDocument::Layer solid, light_field;
    solid.solid = schemas::ShotDocument::Solid{{kBright, kBright, kBright}, 1, kSolidDepth};
    light_field.take = "take";
    light_field.method = "depth";
    shot.layers = {solid, light_field};
    schemas::write_shot(shot, path(name + ".json"));
    const CommandResult rendered = run_raystage("render --progress none " + quoted(name + ".json") +
                                                " -o " + quoted(name + ".####.exr"));
    EXPECT_EQ(rendered.exit_code, 0) << rendered.output;
    if (rendered.exit_code != 0) return -1;
    constexpr images::ExrChannel kGreen[]{{"G"}};
    const auto green = images::read_exr_channels(path(name + ".0001.exr"), kGreen, "");
    int wrong = 0;
    for (int y = 0; y < kViewHeight; ++y) {
      for (int x = 0; x < kViewWidth; ++x) {
        const double focal = kViewWidth / 2.0 / std::tan(kFovDeg * kDegree / 2);
        const Eigen::Vector3d ray((x + 0.5 - kViewWidth / 2.0) / focal,
                                  -(y + 0.5 - kViewHeight / 2.0) / focal, -1);
        const bool is_solid = green.values.at(y * kViewWidth + x) > kBright / 2;
        wrong += is_solid == hits_bar(kViewPosition, ray) ? 1 : 0;
      }
    }
    return wrong;
  }

  static constexpr double kBright = 4;  ///< of the solid; the scene is darker than 1
  TestFolder folder_;
};

TEST_F(DepthMapsCommand, ImportedDepthsDecideWhatCoversWhatInMerges) {
  const int estimated = wrong_pixels("estimated");
  write_maps("true", {});
  import_maps("true");
  const int with_true = wrong_pixels("with_true");
  // The bars are said to be behind the solid.
  write_maps("far", 5);
  import_maps("far");
  const int with_far = wrong_pixels("with_far");
  // Of 3072 pixels, 465 estimated, 53 with true depths (edges of bars) and 1056 with far ones.
  EXPECT_GT(estimated, 200);
  EXPECT_GE(with_true, 0);
  EXPECT_LT(with_true, 100);
  EXPECT_GT(with_far, 900);
}

/// Exports the depths and compares them with what other programs read.
class ExportedDepths : public DepthMapsCommand {
 protected:
  CommandResult here(const std::string& command) const {
    return run_in_shell("cd '" + folder_.path().string() + "' && " + command);
  }
};

TEST_F(ExportedDepths, OpenImageIoReadsTheExr) {
  ASSERT_EQ(here("command -v oiiotool").exit_code, 0) << "oiiotool is not installed";
  ASSERT_EQ(run_raystage("export depth -q " + quoted("take") + " -o " + quoted("maps")).exit_code,
            0);
  constexpr images::ExrChannel kZ[]{{"Z"}};
  for (const std::string file : {"maps/r0c0/000001.exr", "maps/r2c1/000001.exr"}) {
    const CommandResult stated = here("oiiotool --info -v " + file);
    EXPECT_EQ(stated.exit_code, 0);
    EXPECT_THAT(stated.output, HasSubstr("96 x   72, 1 channel, float openexr"));
    EXPECT_THAT(stated.output, HasSubstr("channel list: Z\n"));
    const auto ours = images::read_exr_channels(path(file), kZ, "");
    std::istringstream dump(here("oiiotool --dumpdata " + file).output);
    std::vector<float> theirs;
    for (std::string line; std::getline(dump, line);) {
      // "    Pixel (0, 0): 6.763609886"
      const std::size_t value = line.find("): ");
      if (line.find("Pixel (") != line.npos) theirs.push_back(std::stof(line.substr(value + 3)));
    }
    EXPECT_EQ(theirs, ours.values);
  }
}

TEST_F(ExportedDepths, BagsStayValid) {
  const std::string bag = quoted("bag"), payload = quoted("bag/data");
  ASSERT_EQ(run_raystage("bag -q " + quoted("take") + " -o " + bag).exit_code, 0);
  const CommandResult exported = run_raystage("export depth " + payload + " -o " + quoted("maps"));
  EXPECT_EQ(exported.exit_code, 0) << exported.output;
  for (const std::string command : {"sync", "repair", "verify --manifest write"}) {
    const CommandResult refused = run_raystage(command + " -q " + payload);
    EXPECT_EQ(refused.exit_code, 2) << command;
    EXPECT_THAT(refused.output, HasSubstr("the payload of a bag")) << command;
  }
  EXPECT_EQ(run_raystage("verify -q " + payload).exit_code, 0);
  const CommandResult check = run_raystage("bag -q --check checksums " + bag);
  EXPECT_EQ(check.exit_code, 0) << check.output;
}

TEST_F(ExportedDepths, RottenFramesAreAbsent) {
  {
    const store::Take take(path("take"));
    const store::FrameRecord record = take.archive(4).frames()[0];
    std::string bytes = read_file(path("take") / take.document().cameras[4].archive);
    bytes[record.offset + record.size / 2] ^= 0x10;
    write_file_atomically(path("take") / take.document().cameras[4].archive, bytes);
  }
  const CommandResult result =
      run_raystage("export depth -q " + quoted("take") + " -o " + quoted("maps"));
  EXPECT_EQ(result.exit_code, 4) << result.output;
  EXPECT_THAT(result.output, HasSubstr("1 stored frames are not as they were recorded"));
  EXPECT_FALSE(fs::exists(path("maps/r1c1/000001.exr")));
  EXPECT_TRUE(fs::exists(path("maps/r0c0/000001.exr")));
}

TEST_F(ExportedDepths, OtherProgramsReadThePng) {
  ASSERT_EQ(here("command -v oiiotool && command -v ffprobe && command -v ffmpeg").exit_code, 0)
      << "oiiotool or ffmpeg is not installed";
  constexpr double kNear = 2, kFar = 8;  // metres
  ASSERT_EQ(run_raystage("export depth -q " + quoted("take") + " -o " + quoted("maps")).exit_code,
            0);
  ASSERT_EQ(run_raystage("export depth -q " + quoted("take") + " -o " + quoted("codes") +
                         " --format png --near 2 --far 8")
                .exit_code,
            0);
  const std::string file = "codes/r2c1/000001.png";
  EXPECT_EQ(here("ffprobe -v error -show_entries stream=codec_name,width,height,pix_fmt -of "
                 "csv=p=0 " +
                 file)
                .output,
            "png,96,72,gray16be\n");
  EXPECT_THAT(here("oiiotool --info -v " + file).output,
              HasSubstr("96 x   72, 1 channel, uint16 png"));
  const CommandResult decoded =
      here("ffmpeg -nostdin -v error -i " + file + " -f rawvideo -pix_fmt gray16le codes.raw");
  ASSERT_EQ(decoded.exit_code, 0) << decoded.output;
  const std::string codes = read_file(path("codes.raw"));
  constexpr images::ExrChannel kZ[]{{"Z"}};
  const auto metres = images::read_exr_channels(path("maps/r2c1/000001.exr"), kZ, "").values;
  ASSERT_EQ(codes.size(), 2 * metres.size());
  for (std::size_t i = 0; i < metres.size(); ++i) {
    const int code =
        static_cast<std::uint8_t>(codes[2 * i]) + 256 * static_cast<std::uint8_t>(codes[2 * i + 1]);
    // As `raystage export depth --help` states it.
    const double wanted =
        metres[i] > 0
            ? std::clamp(65535 * (1 / double{metres[i]} - 1 / kFar) / (1 / kNear - 1 / kFar), 1.0,
                         65535.0)
            : 0;
    ASSERT_NEAR(code, wanted, metres[i] > 0 ? 0.51 : 0) << "pixel " << i;
  }
}

}  // namespace
}  // namespace raystage::testing
