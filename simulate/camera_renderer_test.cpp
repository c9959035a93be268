// SPDX-License-Identifier: Apache-2.0
#include "simulate/camera_renderer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>
#include <string>

#include "base/error.h"
#include "rig/rig.h"
#include "simulate/sensor_model.h"
#include "simulate/simulated_rig.h"

namespace raystage::simulate {
namespace {

// A camera with distortion and mounting errors, and its image.
struct Shoot {
  Shoot(const std::string& scene_name, int width, int height)
      : scene(make_scene(scene_name)), geometry(scene), world(geometry) {
    SimulationOptions options;
    options.width = width;
    options.height = height;
    options.rows = options.columns = 2;
    rig = rig::rig_from_document(make_simulated_rig(options).truth);
  }
  const rig::Rig::Camera& camera() const { return rig.cameras[1]; }
  PixelRays rays() const { return PixelRays(camera().model, camera().pose); }
  int part(const std::string& name) const {
    for (std::size_t i = 0; i < scene.parts.size(); ++i) {
      if (scene.parts[i].name == name) return static_cast<int>(i);
    }
    return -1;
  }

  Scene scene;
  SceneGeometry geometry;
  World world;
  rig::Rig rig;
  CameraRenderer renderer;
};

double psnr(const store::RgbImage& a, const store::RgbImage& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    const double difference = static_cast<double>(a.values[i]) - b.values[i];
    sum += difference * difference;
  }
  return 10 * std::log10(255.0 * 255.0 * static_cast<double>(a.values.size()) / sum);
}

TEST(CameraImage, PixelsSeeWhatTheCameraModelProjectsThere) {
  Shoot shoot("chart", 160, 120);
  const PixelRays rays = shoot.rays();
  StaticSampleCache cache;
  LinearImage image;
  shoot.renderer.render(shoot.world, rays, 1, cache, image);
  std::map<int, Eigen::Vector3d> centroid;  // of the pixels of each part: x, y, count
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      const LightSample& sample = image.centre[row * image.width + column];
      ASSERT_GE(sample.part, 0);
      const Ray ray = rays.ray(column, row, 0.5F, 0.5F);
      const Eigen::Vector3d point = (ray.origin + ray.direction * sample.distance).cast<double>();
      const auto pixel = shoot.camera().model.project(shoot.camera().pose.camera_from_world(point));
      ASSERT_TRUE(pixel);
      EXPECT_NEAR(pixel->x(), column + 0.5, 2e-3);
      EXPECT_NEAR(pixel->y(), row + 0.5, 2e-3);
      if (sample.part == 0) {
        EXPECT_NEAR(point.z(), -4, 1e-4);
      }
      centroid.try_emplace(sample.part, 0, 0, 0).first->second +=
          Eigen::Vector3d(column + 0.5, row + 0.5, 1);
    }
  }
  // Projects known positions of the scene with the camera model.
  const Eigen::Vector3d centres[] = {
      {-0.5, 0.3, -2}, {0.6, 0.4, -2.5}, {-0.7, -0.4, -3}, {0.4, -0.3, -2.2}};
  for (int ball = 0; ball < 4; ++ball) {
    const int part = shoot.part(std::to_string(ball).insert(0, "ball"));
    ASSERT_TRUE(centroid.contains(part));
    const Eigen::Vector3d& sum = centroid.at(part);
    const auto pixel =
        shoot.camera().model.project(shoot.camera().pose.camera_from_world(centres[ball]));
    EXPECT_NEAR(sum.x() / sum.z(), pixel->x(), 0.35) << ball;
    EXPECT_NEAR(sum.y() / sum.z(), pixel->y(), 0.35) << ball;
  }
}

TEST(CameraImage, RaysBetweenPixelCentresFollowTheModelToo) {
  const Shoot shoot("chart", 160, 120);
  const PixelRays rays = shoot.rays();
  for (const int row : {0, 60, 119}) {
    for (const int column : {0, 80, 159}) {
      const Ray ray = rays.ray(column, row, 0.9F, 0.2F);
      const Eigen::Vector3d point = (ray.origin + 3 * ray.direction).cast<double>();
      const auto pixel = shoot.camera().model.project(shoot.camera().pose.camera_from_world(point));
      ASSERT_TRUE(pixel);
      EXPECT_NEAR(pixel->x(), column + 0.9, 3e-3);
      EXPECT_NEAR(pixel->y(), row + 0.2, 3e-3);
    }
  }
}

class StageImage : public ::testing::Test {
 protected:
  // Once for all tests, as painting the textures takes time.
  static void SetUpTestSuite() { shoot_ = std::make_unique<Shoot>("stage", 320, 240); }
  static void TearDownTestSuite() { shoot_.reset(); }
  static inline std::unique_ptr<Shoot> shoot_;
};

TEST_F(StageImage, ShowsThinThingsAndTheMirror) {
  Shoot& shoot = *shoot_;
  const PixelRays rays = shoot.rays();
  StaticSampleCache cache;
  LinearImage image;
  std::map<int, int> seen, mirrored;
  for (int instant = 0; instant < 8; ++instant) {
    shoot.world.set_time(0.5 * instant);
    shoot.renderer.render(shoot.world, rays, 1, cache, image);
    for (const LightSample& sample : image.centre) {
      ++seen[sample.part];
      if (sample.part == shoot.part("mirror")) ++mirrored[sample.reflected_part];
    }
  }
  for (const char* name : {"fence", "string", "wheel", "lamp wire left", "pendulum wire", "mirror",
                           "beach ball", "ring", "curtains", "poster", "floor", "backdrop"}) {
    EXPECT_GT(seen[shoot.part(name)], 100) << name;
  }
  EXPECT_GT(mirrored[shoot.part("walls")], 1000);
  EXPECT_GT(mirrored[shoot.part("floor")], 1000);
  const int balls = mirrored[shoot.part("rolling ball")] + mirrored[shoot.part("beach ball")];
  EXPECT_GT(balls, 50) << "what moves is seen in the mirror too";
}

TEST_F(StageImage, MirrorFollowsTheLawOfReflection) {
  Shoot& shoot = *shoot_;
  const PixelRays rays = shoot.rays();
  shoot.world.set_time(1);
  StaticSampleCache cache;
  LinearImage image;
  shoot.renderer.render(shoot.world, rays, 1, cache, image);
  const SceneMesh& glass = shoot.scene.parts[shoot.part("mirror")].mesh;
  const Eigen::Vector3f normal = glass.normals[0], corner = glass.positions[0];
  int checked = 0;
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      const LightSample& sample = image.centre[row * image.width + column];
      if (sample.reflected_part != shoot.part("floor")) continue;
      // Equivalent: a camera behind the mirror whose ray continues straight to the floor.
      Ray ray = rays.ray(column, row, 0.5F, 0.5F);
      const auto flip = [&](const Eigen::Vector3f& v, float offset) -> Eigen::Vector3f {
        return v - 2 * (v.dot(normal) - offset) * normal;
      };
      const Eigen::Vector3f origin = flip(ray.origin, corner.dot(normal));
      const Eigen::Vector3f point =
          origin + flip(ray.direction, 0) * (sample.distance + sample.reflected_distance);
      ASSERT_NEAR(point.y(), -1.25F, 3e-3F);
      ++checked;
    }
  }
  EXPECT_GT(checked, 100);
}

TEST_F(StageImage, CacheChangesNothing) {
  Shoot& shoot = *shoot_;
  const PixelRays rays = shoot.rays();
  StaticSampleCache used, small(1000);
  LinearImage image;
  for (const double seconds : {0.3, 1.1}) {
    shoot.world.set_time(seconds);
    shoot.renderer.render(shoot.world, rays, 4, used, image);
    shoot.renderer.render(shoot.world, rays, 4, small, image);
  }
  StaticSampleCache fresh;
  LinearImage from_used, from_small, from_fresh;
  shoot.world.set_time(2.2);
  shoot.renderer.render(shoot.world, rays, 4, used, from_used);
  shoot.renderer.render(shoot.world, rays, 4, small, from_small);
  shoot.renderer.render(shoot.world, rays, 4, fresh, from_fresh);
  EXPECT_EQ(develop(from_used).values, develop(from_fresh).values);
  EXPECT_EQ(develop(from_small).values, develop(from_fresh).values);
}

TEST_F(StageImage, QuickPicturesAreLikeCarefulOnes) {
  Shoot& shoot = *shoot_;
  const PixelRays rays = shoot.rays();
  shoot.world.set_time(1.4);
  StaticSampleCache cache;
  LinearImage quick, careful;
  shoot.renderer.render(shoot.world, rays, 4, cache, quick);
  shoot.renderer.render_supersampled(shoot.world, rays, 64, careful);
  const double db = psnr(develop(quick), develop(careful));
  RecordProperty("psnr", std::to_string(db));
  EXPECT_GT(db, 33);
}

// Each row is that of a picture with a global shutter at the row's own time.
TEST_F(StageImage, RollingShutterShowsEachRowAtItsOwnTime) {
  Shoot& shoot = *shoot_;
  const PixelRays rays = shoot.rays();
  for (const double read_out : {0.03, -0.03}) {
    const Exposure exposure{1.3, read_out / rays.height()};
    StaticSampleCache rolling_cache, global_cache;
    LinearImage rolling, global, middle;
    for (const int times : {1, 2}) {
      shoot.renderer.render(shoot.world, exposure, rays, 1, rolling_cache, rolling);
      int changed = 0;
      shoot.renderer.render(shoot.world, {exposure.seconds, 0}, rays, 1, global_cache, middle);
      for (const int row : {0, 31, 119, 120, 200, 239}) {
        const double seconds = exposure.seconds_of_row(row, rays.height());
        EXPECT_NEAR(seconds, 1.3 + read_out * ((row + 0.5) / 240 - 0.5), 1e-12);
        shoot.world.set_time(seconds);
        shoot.renderer.render(shoot.world, rays, 1, global_cache, global);
        for (int column = 0; column < rays.width(); ++column) {
          const std::size_t at = static_cast<std::size_t>(row) * 320 + column;
          EXPECT_EQ(rolling.light[at], global.light[at]) << row << " " << column << " " << times;
          changed += rolling.light[at] != middle.light[at] ? 1 : 0;
        }
      }
      EXPECT_GT(changed, 50);
    }
  }
}

// Supersampled edges have the time of their row, too: the picture is that of the rows of pictures
// with a global shutter but for pixels whose neighbours decide about an edge.
TEST_F(StageImage, RollingShutterHasEdgesOfEachRow) {
  Shoot& shoot = *shoot_;
  const PixelRays rays = shoot.rays();
  const Exposure exposure{1.3, 0.03 / rays.height()};
  StaticSampleCache rolling_cache, global_cache;
  LinearImage rolling, global, rows;
  shoot.renderer.render(shoot.world, exposure, rays, 4, rolling_cache, rolling);
  rows = rolling;
  for (int row = 3; row < rays.height(); row += 12) {
    shoot.world.set_time(exposure.seconds_of_row(row, rays.height()));
    shoot.renderer.render(shoot.world, rays, 4, global_cache, global);
    std::copy_n(global.light.begin() + row * 320, 320, rows.light.begin() + row * 320);
  }
  EXPECT_GT(psnr(develop(rolling), develop(rows)), 60);
}

TEST_F(StageImage, MovesWithTime) {
  Shoot& shoot = *shoot_;
  const int ball = shoot.part("beach ball");
  shoot.world.set_time(1);
  const Eigen::Vector3f before = shoot.world.world_from_part(ball).translation();
  shoot.world.set_time(1.1);
  EXPECT_GT((shoot.world.world_from_part(ball).translation() - before).norm(), 0.01F);
}

TEST(Texture, AveragesWhatIsFinerThanThePixel) {
  const Texture checks(64, 64, [](float u, float v) -> Eigen::Vector3f {
    const bool light = (static_cast<int>(u * 32) + static_cast<int>(v * 32)) % 2 == 0;
    return Eigen::Vector3f::Constant(light ? 1.0F : 0.0F);
  });
  // A pixel as wide as eight squares shows their mean at any position.
  for (const float u : {0.1F, 0.33F, 0.6F}) {
    EXPECT_NEAR(checks.sample({u, 0.4F}, {0.25F, 0}, {0, 0.25F}).x(), 0.5F, 0.01F);
  }
  // A pixel much smaller than a square shows the square.
  EXPECT_NEAR(checks.sample({0.5F / 32, 0.5F / 32}, {0.001F, 0}, {0, 0.001F}).x(), 1, 1e-5F);
  // Stretched along one axis, it averages along that axis only.
  const Texture stripes(64, 64, [](float u, float) -> Eigen::Vector3f {
    return Eigen::Vector3f::Constant(u < 0.5F ? 1.0F : 0.0F);
  });
  EXPECT_NEAR(stripes.sample({0.25F, 0.5F}, {0, 0.5F}, {0.02F, 0}).x(), 1, 1e-5F);
}

TEST(Scene, UnknownNamesAreRefused) {
  try {
    make_scene("moon");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_NE(std::string(error.what()).find("stage"), std::string::npos);
  }
}

}  // namespace
}  // namespace raystage::simulate
