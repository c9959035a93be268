// SPDX-License-Identifier: Apache-2.0
// A scene that is all geometry, and the same with half of it replaced by its own light field.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "compose/layers/cryptomatte.h"
#include "compose/sequence_test_data.h"
#include "images/exr/exr_channels.h"

namespace raystage {
namespace {

constexpr int kSide = 5, kCameraWidth = 320, kCameraHeight = 240;
constexpr double kSpacing = 0.08, kCameraFov = 56;

/// Once for all tests: pictures of the half that becomes a light field, as a take.
class GeometryTruth : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TestFolder>();
    write_meshes();
    write_take();
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static std::filesystem::path path(const std::string& name) { return folder_->path() / name; }

  static void write_meshes() {
    std::ofstream plane(path("plane.obj"));
    plane << "o plane\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
             "f 1/1 2/2 3/3 4/4\n";
    std::ofstream ball(path("ball.obj"));
    ball << "o ball\n";
    constexpr int kSteps = 40;
    for (int row = 0; row <= kSteps; ++row) {
      for (int column = 0; column <= 2 * kSteps; ++column) {
        const double p = std::numbers::pi * row / kSteps, t = std::numbers::pi * column / kSteps;
        const double x = std::sin(p) * std::cos(t), y = std::cos(p), z = std::sin(p) * std::sin(t);
        ball << "v " << x << ' ' << y << ' ' << z << "\nvn " << x << ' ' << y << ' ' << z << "\nvt "
             << column / (2.0 * kSteps) << ' ' << 1 - row / double{kSteps} << '\n';
      }
    }
    const auto corner = [](int row, int column) {
      const std::string i = std::to_string(row * (2 * kSteps + 1) + column + 1);
      return i + '/' + i + '/' + i + ' ';
    };
    for (int row = 0; row < kSteps; ++row) {
      for (int column = 0; column < 2 * kSteps; ++column) {
        ball << "f " << corner(row, column) << corner(row + 1, column)
             << corner(row + 1, column + 1) << corner(row, column + 1) << '\n';
      }
    }
    std::ofstream texture(path("texture.ppm"), std::ios::binary);
    constexpr int kTexels = 256;
    texture << "P6 " << kTexels << ' ' << kTexels << " 255\n";
    for (int y = 0; y < kTexels; ++y) {
      for (int x = 0; x < kTexels; ++x) {
        for (const double turn : {0.0, 2.1, 4.2}) {
          const double wave = std::sin(0.19 * x + 0.07 * y + turn) +
                              std::sin(0.11 * y - 0.05 * x + 2 * turn) +
                              std::sin(0.023 * (x + 2 * y) + turn);
          texture.put(static_cast<char>(static_cast<unsigned char>(128 + 40 * wave)));
        }
      }
    }
  }

  static ShotDocument::Layer mesh(const std::string& name, const std::string& file,
                                  const std::array<double, 3>& position, double scale) {
    ShotDocument::Layer layer;
    layer.name = name;
    ShotDocument::Geometry geometry{.file = file};
    geometry.material = ShotDocument::Material{.color = {{1, 1, 1}}, .texture = "texture.ppm"};
    geometry.keys = {{.frame = 1, .position = position, .scale = scale}};
    geometry.samples = 16;
    layer.geometry = geometry;
    return layer;
  }
  /// What becomes the light field, and what stays geometry.
  static std::vector<ShotDocument::Layer> set() {
    return {mesh("backdrop", "plane.obj", {0, 0, -6}, 6),
            mesh("left", "ball.obj", {-0.7, 0.1, -3.6}, 0.5)};
  }
  static std::vector<ShotDocument::Layer> props() {
    return {mesh("right", "ball.obj", {0.45, -0.1, -3.2}, 0.45),
            mesh("behind", "ball.obj", {-0.35, 0.35, -4.3}, 0.5)};
  }

  static ShotDocument shot_from(const std::array<double, 3>& eye, double fov, int width,
                                int height) {
    ShotDocument shot;
    shot.width = width;
    shot.height = height;
    shot.merge = ShotDocument::Merge::kDepth;
    shot.camera.keys = {testing::camera_key(1, {eye[0], eye[1], eye[2]}, fov)};
    shot.lights = {{.ambient = {{0.5, 0.5, 0.5}}},
                   {.direction = {{-0.3, -0.6, -0.7}}, .color = {0.4, 0.4, 0.4}, .shadows = false}};
    shot.output.cryptomatte = true;
    return shot;
  }

  struct Picture {
    ExrImage image;
    std::vector<float> front;  ///< id of the object that most of a pixel shows
  };
  static Picture render(const ShotDocument& shot) {
    write_shot(shot, path("shot.json"));
    SequenceOptions options;
    options.output = path("out.####.exr").string();
    options.program_version = "0.1.0";
    options.existing = ExistingFiles::kOverwrite;
    options.say = [](std::string_view) {};
    options.progress = [](double) {};
    render_sequence(path("shot.json"), options, {});
    constexpr ExrChannel kIds[] = {{"CryptoObject00.R"}};
    return {read_exr(path("out.0001.exr")),
            read_exr_channels(path("out.0001.exr"), kIds, "").values};
  }

  static void write_take() {
    TakeDocument take;
    take.name = "set";
    take.created_by = "test";
    take.epoch_utc = 1'700'000'000 * kNanosecondsPerSecond;
    take.nominal_fps = 24;
    take.color_space = "srgb_texture";
    take.depth_range = DepthRange{2.5, 7};
    RigDocument rig;
    rig.name = "grid";
    for (int i = 0; i < kSide * kSide; ++i) {
      RigDocument::Camera camera;
      CameraGeometry& g = camera.geometry;
      g.id = "c" + std::to_string(i);
      g.width = kCameraWidth;
      g.height = kCameraHeight;
      const double focal = kCameraWidth / 2.0 / std::tan(kCameraFov * std::numbers::pi / 360);
      g.intrinsics = {focal, focal, kCameraWidth / 2.0, kCameraHeight / 2.0, {}};
      g.world_from_camera[3] = kSpacing * (i % kSide - kSide / 2);
      g.world_from_camera[7] = -kSpacing * (i / kSide - kSide / 2);
      rig.cameras.push_back(camera);
      take.cameras.push_back({g.id, "", "", ""});
    }
    TakeWriter writer(path("take"), take, rig);
    for (int i = 0; i < kSide * kSide; ++i) {
      const CameraGeometry& g = rig.cameras[static_cast<std::size_t>(i)].geometry;
      ShotDocument shot = shot_from({g.world_from_camera[3], g.world_from_camera[7], 0}, kCameraFov,
                                    kCameraWidth, kCameraHeight);
      shot.layers = set();
      for (ShotDocument::Layer& layer : shot.layers) layer.geometry->samples = 4;
      const ExrImage seen = render(shot).image;
      RgbImage picture{kCameraWidth, kCameraHeight, {}};
      for (std::size_t pixel = 0; pixel < seen.rgba.size() / 4; ++pixel) {
        for (std::size_t c = 0; c < 3; ++c) {
          const double code = srgb_from_linear(double{seen.rgba[4 * pixel + c]});
          picture.pixels.push_back(static_cast<std::uint8_t>(std::lround(255 * code)));
        }
      }
      writer.archive(i).append(encode_jpeg(picture, {.quality = 98}), 0);
    }
    writer.commit();
    write_timeline(build_timeline(Take(path("take")), 24, 0), path("take"));
  }

  static ShotDocument::Layer light_field() {
    ShotDocument::Layer layer;
    layer.name = "set";
    layer.take = "take";
    layer.method = "depth";
    return layer;
  }

  /// Of sRGB codes, full scale 1, over the pixels where `counts`.
  template <class Counts>
  static double psnr(const ExrImage& a, const ExrImage& b, const Counts& counts) {
    double sum = 0;
    std::size_t values = 0;
    for (std::size_t i = 0; i < a.rgba.size(); ++i) {
      if (i % 4 == 3 || !counts(i / 4)) continue;
      const auto code = [&](const ExrImage& image) {
        return srgb_from_linear(std::clamp(double{image.rgba[i]}, 0.0, 1.0));
      };
      sum += std::pow(code(a) - code(b), 2);
      ++values;
    }
    EXPECT_GT(values, 3000U);
    return -10 * std::log10(sum / static_cast<double>(values));
  }

  static std::unique_ptr<TestFolder> folder_;
};

std::unique_ptr<TestFolder> GeometryTruth::folder_;

TEST_F(GeometryTruth, HalfOfItAsALightFieldLooksTheSame) {
  ShotDocument shot = shot_from({0.05, 0.03, -0.1}, 44, 240, 180);
  shot.layers = set();
  for (const auto& layer : props()) shot.layers.push_back(layer);
  const Picture truth = render(shot);
  shot.layers = props();
  shot.layers.insert(shot.layers.begin(), light_field());
  const Picture mixed = render(shot);
  const double error = psnr(truth.image, mixed.image, [](std::size_t) { return true; });
  std::size_t wrong = 0, shown = 0;
  for (const char* prop : {"right/ball", "behind/ball"}) {
    const float id = object_id(prop);
    for (std::size_t i = 0; i < truth.front.size(); ++i) {
      wrong += (truth.front[i] == id) != (mixed.front[i] == id);
      shown += truth.front[i] == id;
    }
  }
  const double share = static_cast<double>(wrong) / static_cast<double>(truth.front.size());
  printf("light field and geometry against all traced: %.2f dB, order wrong in %.3f %% of pixels\n",
         error, 100 * share);
  EXPECT_GT(shown, 3000U);
  EXPECT_GT(error, 35);
  EXPECT_LT(share, 0.005);
}

TEST_F(GeometryTruth, ReflectionsByLightFieldAreNearerThanByEnvironmentMap) {
  // A mirror for a floor, in which the backdrop and the left ball are seen.
  ShotDocument::Layer floor = mesh("floor", "plane.obj", {0, -0.75, -3.6}, 2);
  floor.geometry->material = ShotDocument::Material{.kind = "mirror", .color = {{0.9, 0.9, 0.9}}};
  const double half = std::sqrt(0.5);
  floor.geometry->keys[0].orientation = {{half, -half, 0, 0}};  // looks up
  ShotDocument shot = shot_from({0.05, 0.03, -0.1}, 44, 240, 180);
  shot.output.cryptomatte = true;
  shot.layers = set();
  shot.layers.push_back(floor);
  const Picture truth = render(shot);

  // The environment as one camera in the middle of the array sees it: what it does not see, grey.
  ShotDocument around = shot_from({0, 0, 0}, 120, 512, 512);
  around.layers = set();
  const ExrImage view = render(around).image;
  constexpr int kWidth = 1024, kHeight = 512;
  std::ofstream map(path("around.ppm"), std::ios::binary);
  map << "P6 " << kWidth << ' ' << kHeight << " 255\n";
  const double focal = 256 / std::tan(std::numbers::pi / 3);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double longitude = 2 * std::numbers::pi * ((x + 0.5) / kWidth - 0.5);
      const double latitude = std::numbers::pi * (0.5 - (y + 0.5) / kHeight);
      const double ahead = std::cos(latitude) * std::cos(longitude);
      const int px =
          static_cast<int>(256 + focal * std::cos(latitude) * std::sin(longitude) / ahead);
      const int py = static_cast<int>(256 - focal * std::sin(latitude) / ahead);
      const bool is_seen = ahead > 0.1 && px >= 0 && px < 512 && py >= 0 && py < 512;
      for (std::size_t c = 0; c < 3; ++c) {
        const double value =
            is_seen ? double{view.rgba[4 * static_cast<std::size_t>(py * 512 + px) + c]} : 0.2;
        map.put(static_cast<char>(std::lround(255 * srgb_from_linear(std::min(value, 1.0)))));
      }
    }
  }
  map.close();

  ShotDocument mirrored = shot;
  mirrored.layers = {light_field(), floor};
  mirrored.lights.push_back({.light_field = "set"});
  const Picture by_light_field = render(mirrored);
  mirrored.lights.back() = {.environment = "around.ppm"};
  const Picture by_map = render(mirrored);
  const auto on_floor = [&](std::size_t pixel) {
    return truth.front[pixel] == object_id("floor/plane");
  };
  const double field = psnr(truth.image, by_light_field.image, on_floor);
  const double environment = psnr(truth.image, by_map.image, on_floor);
  printf("reflection against traced: by light field %.2f dB, by environment map %.2f dB\n", field,
         environment);
  EXPECT_GT(field, environment + 6);
}

}  // namespace
}  // namespace raystage
