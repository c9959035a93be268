// SPDX-License-Identifier: Apache-2.0
#include "render/sampling/depth_sampling.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <random>

#include "base/transfer_function.h"
#include "render/common/ray_cells.h"
#include "render/sampling/depth_planning.h"
#include "testing/test_simd_targets.h"

namespace raystage::render {
namespace {

constexpr int kWidth = 61, kHeight = 47;

/// A fisheye camera that sees up to `half_angle`, radians, from its axis.
rig::Rig::Camera fisheye_at(double turn, schemas::Projection projection, double half_angle) {
  schemas::CameraGeometry geometry;
  geometry.id = "f";
  geometry.width = kWidth;
  geometry.height = kHeight;
  geometry.intrinsics = {18, 17.5, 30.2, 23.1, {}, projection, {-0.03, 0.001, 0, 0}, half_angle};
  rig::Pose pose;
  pose.position = {0.05, 0.02, -0.1};
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(turn, Eigen::Vector3d(0.3, 1, 0.1).normalized()).toRotationMatrix();
  return {"f", rig::CameraModel(geometry), pose, {}, {}, {}};
}

rig::Rig::Camera camera_at(const Eigen::Vector3d& position, double turn,
                           const schemas::Distortion& distortion) {
  schemas::CameraGeometry geometry;
  geometry.id = "c";
  geometry.width = kWidth;
  geometry.height = kHeight;
  geometry.intrinsics = {48, 47, 30.2, 23.1, distortion};
  rig::Pose pose;
  pose.position = position;
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(turn, Eigen::Vector3d(0.3, 1, 0.1).normalized()).toRotationMatrix();
  return {"c", rig::CameraModel(geometry), pose, {}, {}, {}};
}

store::DecodedFrame random_frame(unsigned seed) {
  store::DecodedFrame frame;
  frame.width = kWidth;
  frame.height = kHeight;
  const std::size_t pixels = kWidth * (kHeight + 1) + 1;
  frame.rgba = std::make_unique<std::uint16_t[]>(4 * pixels);
  std::mt19937 random(seed);
  for (std::size_t i = 0; i < 4 * kWidth * kHeight; ++i) {
    frame.rgba[i] = i % 4 == 3 ? std::uint16_t{65535} : static_cast<std::uint16_t>(random());
  }
  return frame;
}

/// A row of random depths and weights, long enough for several chunks and an odd end.
struct Row {
  explicit Row(unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> unit(0, 1);
    for (std::size_t i = 0; i < 150; ++i) {
      inverse_depth.push_back(i % 17 == 0 ? 0.0F : 2 * unit(random));
      weight.push_back(i % 13 == 0 ? 0.0F : unit(random));
    }
    inverse_depth[5] = std::numeric_limits<float>::quiet_NaN();
  }
  std::vector<float> inverse_depth, weight;
};

VirtualCamera test_view() {
  rig::Pose pose;
  pose.position = {0.1, -0.05, 0.2};
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()).toRotationMatrix();
  return virtual_camera_with_fov(160, 100, 1.2, pose);
}

const std::vector<std::pair<rig::Rig::Camera, const char*>>& cameras() {
  static const std::vector<std::pair<rig::Rig::Camera, const char*>> all{
      {camera_at({0, 0, 0}, 0, {}), "beside"},
      {camera_at({0.3, 0.1, -0.1}, 0.15, {-0.25, 0.06, 0.002, -0.003, 0.001}), "turned, distorted"},
      {camera_at({0, 0, -0.6}, 0.1, {}), "in front, partly passed"},
      {fisheye_at(0.3, schemas::Projection::kFtheta, 1.2), "f-theta"},
      {fisheye_at(0.1, schemas::Projection::kOrthographic, 1.4), "orthographic"},
      {fisheye_at(1.5, schemas::Projection::kEquisolid, 2.0), "beyond a hemisphere"},
      {camera_at({0, 0, 0}, 3.0, {}), "looking away"}};
  return all;
}

void expect_samples_equal_reference(Interpolation interpolation) {
  const store::DecodedFrame frame = random_frame(7);
  const VirtualCamera view = test_view();
  const Eigen::Matrix3d ray_from_pixel = world_ray_from_pixel(view);
  const Row row(11);
  for (const auto& [camera, name] : cameras()) {
    SCOPED_TRACE(name);
    DepthSource source = depth_source(view, camera);
    source.camera.rgba = frame.rgba.get();
    double seen = 0;
    for (const int y : {0, 37, 99}) {
      std::vector<float> sums(4 * row.weight.size(), 3.0F);
      add_samples_at_depth(source, 4, y, row.inverse_depth, row.weight, interpolation, sums);
      for (std::size_t i = 0; i < row.weight.size(); ++i) {
        const Eigen::Vector3d ray =
            ray_from_pixel * Eigen::Vector3d(4 + static_cast<double>(i) + 0.5, y + 0.5, 1);
        const DepthSample expected = sample_at_depth_reference(
            view.pose.position, ray, row.inverse_depth[i], camera, frame, interpolation);
        const double weight = row.weight[i] * expected.seen;
        seen += weight;
        // Codes differ by up to 65535 between neighbouring pixels, so 1e-4 px of rounding is
        // visible.
        for (std::size_t c = 0; c < 3; ++c) {
          EXPECT_NEAR((sums[4 * i + c] - 3) / 65535, weight * expected.code[c], 2e-4) << i;
        }
        EXPECT_NEAR((sums[4 * i + 3] - 3) / 65535, weight, 5e-5) << i;
      }
    }
    if (name != std::string("looking away")) {
      EXPECT_GT(seen, 5);
    } else {
      EXPECT_EQ(seen, 0);
    }
  }
}

TEST(DepthSampling, EveryInstructionSetAgreesWithTheReference) {
  testing::for_each_simd_target(kernel_target, [&] {
    expect_samples_equal_reference(Interpolation::kLinear);
    expect_samples_equal_reference(Interpolation::kCubic);
  });
}

/// Compares the positions of a fisheye of 3360x2160 pixels with CameraModel, at random rays.
void expect_fisheye_positions(const schemas::Intrinsics& intrinsics, float code_per_pixel,
                              const store::DecodedFrame& columns) {
  schemas::CameraGeometry geometry;
  geometry.id = "f";
  geometry.width = columns.width;
  geometry.height = columns.height;
  geometry.intrinsics = intrinsics;
  rig::Rig::Camera camera{"f", rig::CameraModel(geometry), {}, {}, {}, {}};
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  const std::vector<float> far(100, 0.0F), all(100, 1.0F);
  int compared = 0;
  for (int i = 0; i < 200; ++i) {
    rig::Pose pose;
    pose.world_from_camera_rotation =
        Eigen::AngleAxisd(3.2 * unit(random),
                          Eigen::Vector3d(unit(random), unit(random), unit(random)).normalized())
            .toRotationMatrix();
    const VirtualCamera view = virtual_camera_with_fov(100, 20, 1.5, pose);
    DepthSource source = depth_source(view, camera);
    source.camera.rgba = columns.rgba.get();
    std::vector<float> sums(400);
    add_samples_at_depth(source, 0, 7, far, all, Interpolation::kLinear, sums);
    for (std::size_t x = 0; x < 100; ++x) {
      const Eigen::Vector3d ray =
          world_ray_from_pixel(view) * Eigen::Vector3d(static_cast<double>(x) + 0.5, 7.5, 1);
      const auto pixel = camera.model.project(ray);
      if (!pixel || sums[4 * x + 3] != 65535.0F) continue;  // fading
      ++compared;
      EXPECT_NEAR(sums[4 * x] / code_per_pixel + 0.5F, pixel->x(), 1e-3);
      EXPECT_NEAR(sums[4 * x + 1] / code_per_pixel + 0.5F, pixel->y(), 1e-3);
    }
  }
  EXPECT_GT(compared, 1000);
}

TEST(DepthSampling, FisheyePositionsAreExactToAThousandthOfAPixel) {
  constexpr int kColumns = 3360, kRows = 2160;
  constexpr float kCodePerPixel = 19;
  store::DecodedFrame frame;
  frame.width = kColumns;
  frame.height = kRows;
  frame.rgba = std::make_unique<std::uint16_t[]>(4 * (std::size_t{kColumns} * (kRows + 1) + 1));
  for (std::size_t y = 0; y < kRows; ++y) {
    for (std::size_t x = 0; x < kColumns; ++x) {
      std::uint16_t* pixel = &frame.rgba[4 * (y * kColumns + x)];
      pixel[0] = static_cast<std::uint16_t>(19 * x);
      pixel[1] = static_cast<std::uint16_t>(19 * y);
      pixel[3] = 65535;
    }
  }
  using schemas::Projection;
  // The first is a camera of facebook360_dep's real rig.
  const std::array<double, 4> real{-0.03413328161902581, 0.0004374554953464843,
                                   -0.0018843963208481174, 0};
  const schemas::Intrinsics ftheta{1115.08, 1115.08,      1682.1, 1083.9, {}, Projection::kFtheta,
                                   real,    1.57079632679};
  schemas::Intrinsics wide = ftheta, equisolid = ftheta, orthographic = ftheta, whole = ftheta;
  wide.half_angle = 2.2;
  wide.radial_distortion = {};
  equisolid.projection = Projection::kEquisolid;
  orthographic.projection = Projection::kOrthographic;
  whole.projection = Projection::kEquisolid;
  whole.radial_distortion = {};
  whole.half_angle = std::nullopt;
  testing::for_each_simd_target(kernel_target, [&] {
    for (const auto& lens : {ftheta, wide, equisolid, orthographic, whole}) {
      expect_fisheye_positions(lens, kCodePerPixel, frame);
    }
  });
}

TEST(DepthSampling, MarksEveryPixelThatIsReadAndNoOther) {
  const VirtualCamera view = test_view();
  const Row row(12);
  store::JpegLayout layout;
  layout.mcu_width = layout.mcu_height = 16;
  layout.mcus_per_row = (kWidth + 15) / 16;
  for (const Interpolation interpolation : {Interpolation::kLinear, Interpolation::kCubic}) {
    for (const auto& [camera, name] : cameras()) {
      SCOPED_TRACE(name);
      store::DecodedFrame frame = random_frame(3);
      DepthSource source = depth_source(view, camera);
      std::vector<std::uint8_t> mcus(16), read(kWidth * kHeight);
      set_mcu_layout(source.camera, layout, mcus.data());
      source.camera.read_pixels = read.data();
      source.camera.rgba = frame.rgba.get();
      mark_samples_at_depth(source, 4, 37, row.inverse_depth, row.weight, interpolation);
      std::vector<float> before(4 * row.weight.size()), after(before);
      add_samples_at_depth(source, 4, 37, row.inverse_depth, row.weight, interpolation, before);
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          const auto at = static_cast<std::size_t>(y * kWidth + x);
          if (read[at]) {
            EXPECT_EQ(mcus[y / 16 * layout.mcus_per_row + x / 16], 1);
          } else {
            frame.rgba[4 * at] = static_cast<std::uint16_t>(frame.rgba[4 * at] + 30000);
          }
        }
      }
      add_samples_at_depth(source, 4, 37, row.inverse_depth, row.weight, interpolation, after);
      EXPECT_EQ(before, after);  // unmarked pixels are not read, or have no weight
    }
  }
}

TEST(DepthSampling, ABlocksPlanHoldsAllThatItsPixelsRead) {
  const VirtualCamera view = test_view();
  store::JpegLayout layout;
  layout.mcu_width = layout.mcu_height = 8;
  layout.mcus_per_row = (kWidth + 7) / 8;
  std::mt19937 random(5);
  std::uniform_real_distribution<float> unit(0, 1);
  const std::vector<float> weight(16, 1.0F);
  int marked = 0;
  for (const auto& [camera, name] : cameras()) {
    SCOPED_TRACE(name);
    for (int trial = 0; trial < 60; ++trial) {
      const int x = static_cast<int>(random() % 144), y = static_cast<int>(random() % 92);
      const float farthest = trial % 5 ? unit(random) : 0.0F;
      const float nearest = farthest + (trial % 7 ? 2 * unit(random) : 0.0F);
      std::vector<std::uint8_t> planned(48), read(48);
      DepthSource source = depth_source(view, camera);
      set_mcu_layout(source.camera, layout, planned.data());
      const Interpolation interpolation =
          trial % 2 ? Interpolation::kCubic : Interpolation::kLinear;
      mark_block(source,
                 {x, x + 16, y, y + 8, static_cast<double>(farthest), static_cast<double>(nearest)},
                 interpolation);
      set_mcu_layout(source.camera, layout, read.data());
      for (int row = y; row < y + 8; ++row) {
        for (int depth = 0; depth < 20; ++depth) {
          std::vector<float> inverse_depth(16);
          for (float& q : inverse_depth) q = farthest + (nearest - farthest) * unit(random);
          mark_samples_at_depth(source, x, row, inverse_depth, weight, interpolation);
        }
      }
      for (std::size_t i = 0; i < read.size(); ++i) {
        EXPECT_LE(read[i], planned[i]) << "trial " << trial << ", MCU " << i;
        marked += read[i];
      }
    }
  }
  EXPECT_GT(marked, 200);
}

TEST(DepthSampling, FinishCutsOffWhatOvershootsAndTurnsCodesIntoLight) {
  const float seen = 65535 * kFullAlphaWeight / 2;  // half of the weight that makes a ray opaque
  const std::vector<float> sums{seen * 0.25F, -900, 2 * seen, seen, 0, 0, 0, 0};
  std::vector<float> rgba(8);
  finish_samples(sums, store::BlendSpace::kPerceptual, 2, rgba);
  EXPECT_NEAR(rgba[0], linear_from_srgb(0.25) * 2 * 0.5, 1e-5);
  EXPECT_EQ(rgba[1], 0);
  EXPECT_NEAR(rgba[2], 1, 1e-5);
  EXPECT_FLOAT_EQ(rgba[3], 0.5F);
  EXPECT_EQ(rgba[7], 0);
  finish_samples(sums, store::BlendSpace::kLinear, 2, rgba);
  EXPECT_FLOAT_EQ(rgba[0], 0.25F);
  EXPECT_FLOAT_EQ(rgba[2], 1);
}

TEST(DepthSampling, ARaySeenBySomeOfItsCamerasIsOpaque) {
  for (const float shares : {1.0F, 0.3F, 1.01F * kFullAlphaWeight}) {
    const float seen = 65535 * shares;
    std::vector<float> rgba{seen * 0.5F, seen, 0, seen};
    finish_samples(rgba, store::BlendSpace::kLinear, 1, rgba);
    EXPECT_NEAR(rgba[0], 0.5, 1e-6) << shares;
    EXPECT_NEAR(rgba[1], 1, 1e-6) << shares;
    EXPECT_NEAR(rgba[3], 1, 1e-6) << shares;
  }
}

TEST(DepthSampling, LooksUpWhereTheInfinitePlaneDoes) {
  // At inverse depth 0 the camera's position does not matter.
  const VirtualCamera view = test_view();
  const DepthSource here = depth_source(view, camera_at({0, 0, 0}, 0.1, {}));
  const DepthSource there = depth_source(view, camera_at({5, 3, 1}, 0.1, {}));
  EXPECT_EQ(here.camera.ideal_from_pixel, there.camera.ideal_from_pixel);
  EXPECT_NE(here.per_inverse_depth, there.per_inverse_depth);
}

}  // namespace
}  // namespace raystage::render
