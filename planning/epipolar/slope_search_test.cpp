// SPDX-License-Identifier: Apache-2.0
#include "planning/epipolar/slope_search.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "planning/epipolar/epipolar_image.h"

namespace raystage::planning {
namespace {

constexpr int kWidth = 96, kHeight = 72;

/// Returns a smooth random texture, 0 to 1, of period 4.
double texture(double x, double y) {
  static const std::vector<double> values = [] {
    std::mt19937 random(3);
    std::vector<double> made(64 * 64);
    for (double& value : made) value = std::uniform_real_distribution<>(0, 1)(random);
    return made;
  }();
  const double u = x * 16, v = y * 16;
  const double left = std::floor(u), top = std::floor(v);
  const auto value = [&](double column, double row) {
    const auto wrap = [](double index) { return (static_cast<long>(index) % 64 + 64) % 64; };
    return values[static_cast<std::size_t>(wrap(row) * 64 + wrap(column))];
  };
  const double a = u - left, b = v - top;
  return (1 - b) * ((1 - a) * value(left, top) + a * value(left + 1, top)) +
         b * ((1 - a) * value(left, top + 1) + a * value(left + 1, top + 1));
}

/// Cameras 0.1 m apart, two rows of three, before a wall that is `depth` metres away.
std::vector<DetailImage> images_of_wall(double depth) {
  std::vector<DetailImage> images;
  for (int i = 0; i < 6; ++i) {
    rig::Pose pose;
    pose.position = {0.1 * (i % 3), 0.1 * (i / 3), 0};
    const auto camera = render::virtual_camera_with_fov(kWidth, kHeight, 1, pose);
    std::vector<std::uint8_t> luma;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const Eigen::Vector3d point = render::point_at_depth(camera, x + 0.5, y + 0.5, depth);
        luma.push_back(static_cast<std::uint8_t>(
            1 + 254 * texture(2 * point.x() / depth, 2 * point.y() / depth)));
      }
    }
    images.push_back(make_detail_image(camera, luma, 1));
  }
  return images;
}

std::vector<render::VirtualCamera> cameras_of(const std::vector<DetailImage>& images) {
  std::vector<render::VirtualCamera> cameras;
  for (const DetailImage& image : images) cameras.push_back(image.camera);
  return cameras;
}

const std::vector<int> kAll{0, 1, 2, 3, 4, 5};

TEST(EpipolarNeighbours, AreNextToTheCameraAndAboveIt) {
  const auto cameras = cameras_of(images_of_wall(2));
  const EpipolarNeighbours found = epipolar_neighbours(cameras, kAll, 1, 3);
  EXPECT_EQ(found[0], std::vector{0});
  EXPECT_EQ(found[1], std::vector{2});
  EXPECT_TRUE(found[2].empty());
  EXPECT_EQ(found[3], std::vector{4});
  const EpipolarNeighbours corner = epipolar_neighbours(cameras, kAll, 0, 3);
  EXPECT_EQ(corner[1], (std::vector{1, 2, 5}));  // nearest first
  EXPECT_EQ(epipolar_neighbours(cameras, kAll, 0, 1)[1], std::vector{1});
}

TEST(SearchSlopes, MeasuresTheDepthOfAWall) {
  for (const double depth : {1.5, 3.0, 20.0}) {
    const std::vector<DetailImage> images = images_of_wall(depth);
    const auto cameras = cameras_of(images);
    const SlopeHypotheses range{-0.05, 1, 120};
    std::vector<MeasuredMap> maps;
    for (const int camera : {1, 4}) {
      maps.push_back(
          search_slopes(images, camera, epipolar_neighbours(cameras, kAll, camera, 2), range));
    }
    std::vector<double> found;
    for (const MeasuredPixel& pixel : confirmed_pixels(maps[0], maps)) {
      found.push_back(pixel.inverse_depth);
    }
    ASSERT_GT(found.size(), 3000U) << depth;
    std::ranges::sort(found);
    EXPECT_NEAR(found[found.size() / 2], 1 / depth, 0.003) << depth;
    EXPECT_NEAR(found[found.size() / 50], 1 / depth, 0.03) << depth;
    EXPECT_NEAR(found[found.size() - found.size() / 50], 1 / depth, 0.03) << depth;
  }
}

TEST(SearchSlopes, MeasuresNothingOutsideOfTheRangeOrWithoutStructure) {
  const std::vector<DetailImage> images = images_of_wall(1.5);
  const auto cameras = cameras_of(images);
  const EpipolarNeighbours neighbours = epipolar_neighbours(cameras, kAll, 1, 2);
  const auto count = [](const MeasuredMap& map) {
    return std::ranges::count_if(map.inverse_depth.values, [](float q) { return !std::isnan(q); });
  };
  EXPECT_LT(count(search_slopes(images, 1, neighbours, {0, 0.3, 60})), 50);
  std::vector<DetailImage> flat = images;
  for (DetailImage& image : flat) std::ranges::fill(image.detail.values, 0.0F);
  EXPECT_EQ(count(search_slopes(flat, 1, neighbours, {0, 1, 60})), 0);
  for (DetailImage& image : flat) {
    std::ranges::fill(image.detail.values, std::numeric_limits<float>::quiet_NaN());
  }
  EXPECT_EQ(count(search_slopes(flat, 1, neighbours, {0, 1, 60})), 0);
  EXPECT_TRUE(search_slopes(images, 1, {}, {0, 1, 60}).inverse_depth.values.empty());
  EXPECT_TRUE(search_slopes(images, 1, neighbours, {0, 1, 1}).inverse_depth.values.empty());
}

TEST(ConfirmedPixels, AreThoseThatAnotherCameraMeasuredAlike) {
  const std::vector<DetailImage> images = images_of_wall(2);
  MeasuredMap one{images[0].camera, Image<float>(kWidth, kHeight, 0.5F), 0.01};
  MeasuredMap same{images[1].camera, Image<float>(kWidth, kHeight, 0.505F), 0.01};
  const MeasuredMap other{images[1].camera, Image<float>(kWidth, kHeight, 0.6F), 0.01};
  // The wall moves by 4.4 pixels; what leaves the other picture is not confirmed.
  const std::vector<MeasuredMap> alike{one, same};
  EXPECT_EQ(confirmed_pixels(alike[0], alike).size(), (kWidth - 5U) * (kHeight - 2U));
  const std::vector<MeasuredMap> unlike{one, other};
  EXPECT_TRUE(confirmed_pixels(unlike[0], unlike).empty());
  const std::vector<MeasuredMap> alone{one};
  EXPECT_TRUE(confirmed_pixels(alone[0], alone).empty());
}

TEST(BoxFilter, EqualsTheMeanOfTheWindow) {
  std::mt19937 random(5);
  for (const auto& [width, height, radius] :
       {std::tuple{9, 7, 2}, {3, 5, 4}, {1, 1, 3}, {8, 2, 0}}) {
    Image<float> image(width, height);
    for (float& value : image.values) value = std::uniform_real_distribution<float>(-9, 9)(random);
    Image<float> filtered = image;
    box_filter(filtered, radius);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        double sum = 0;
        int count = 0;
        for (int row = y - radius; row <= y + radius; ++row) {
          for (int column = x - radius; column <= x + radius; ++column) {
            if (!image.contains(column, row)) continue;
            sum += static_cast<double>(image.at(column, row));
            ++count;
          }
        }
        EXPECT_NEAR(static_cast<double>(filtered.at(x, y)), sum / count, 1e-5);
      }
    }
  }
}

// A point in the middle of the line moves as the image says, also between cameras of other focal
// lengths, depths and rotations.
TEST(EpipolarImages, ShiftsAreThoseOfPoints) {
  std::vector<render::VirtualCamera> cameras;
  for (int i = 0; i < 3; ++i) {
    rig::Pose pose;
    pose.position = {0.1 * i, 0, 0.03 * (i % 2)};
    pose.world_from_camera_rotation =
        Eigen::AngleAxisd(0.05 * i, Eigen::Vector3d::UnitY()).toRotationMatrix();
    cameras.push_back(render::virtual_camera_with_fov(kWidth, kHeight, 1 + 0.1 * i, pose));
  }
  const std::vector<std::vector<std::uint8_t>> luma(
      3, std::vector<std::uint8_t>(std::size_t{kWidth} * kHeight, 100));
  const EpipolarImage image =
      make_epipolar_image(cameras, luma, std::vector{0, 1, 2}, 1, EpipolarAxis::kRow);
  ASSERT_EQ(image.shift_at_one_metre.size(), 3U);
  EXPECT_EQ(image.shift_at_one_metre[1], 0);
  for (std::size_t i = 0; i < 3; ++i) {
    // The point at a small inverse depth behind the middle of line and picture, as the camera sees
    // it; its direction alone decides where the camera's pixel is drawn.
    constexpr double kInverseDepth = 1e-4;
    const Eigen::Vector3d point =
        render::point_at_depth(cameras[1], kWidth / 2.0, kHeight / 2.0, 1 / kInverseDepth);
    const Eigen::Vector3d direction = point - cameras[i].pose.position;
    const Eigen::Vector3d seen = cameras[1].pose.world_from_camera_rotation.transpose() * direction;
    const double x = kWidth / 2.0 + cameras[1].intrinsics.fx * seen.x() / -seen.z();
    EXPECT_NEAR((x - kWidth / 2.0) / kInverseDepth, image.shift_at_one_metre[i], 1e-2);
  }
  for (const std::uint8_t code : image.luma.row(1)) EXPECT_EQ(code, 100);
}

}  // namespace
}  // namespace raystage::planning
