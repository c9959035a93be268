// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "render/depth/estimation_kernels.h"

namespace raystage::testing {

constexpr int kWidth = 53, kHeight = 31;

inline render::VirtualCamera camera_at(const Eigen::Vector3d& position, double yaw) {
  rig::Pose pose;
  pose.position = position;
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return render::virtual_camera_with_fov(kWidth, kHeight, 0.8, pose);
}

/// Returns a random image. `bend`: k1 of the lens; above 0 the frame does not show the pinhole's
/// corners.
inline render::MatchingImage random_image(unsigned seed, const render::VirtualCamera& pinhole,
                                          double bend) {
  store::DecodedFrame frame;
  frame.width = pinhole.width;
  frame.height = pinhole.height;
  const auto pixels = static_cast<std::size_t>(frame.width * frame.height);
  frame.rgba = std::make_unique<std::uint16_t[]>(4 * pixels);
  std::mt19937 random(seed);
  for (std::size_t i = 0; i < 4 * pixels; ++i) {
    frame.rgba[i] = static_cast<std::uint16_t>(random());
  }
  schemas::CameraGeometry geometry;
  geometry.id = "c";
  geometry.width = pinhole.width;
  geometry.height = pinhole.height;
  geometry.intrinsics = pinhole.intrinsics;
  geometry.intrinsics.distortion.k1 = bend;
  return {frame,
          {store::BlendSpace::kPerceptual, 1},
          {"c", rig::CameraModel(geometry), pinhole.pose, {}, {}, {}},
          pinhole};
}

inline render::InverseDepthMap random_depths(unsigned seed, float least, float most) {
  render::InverseDepthMap map(kWidth, kHeight);
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> depth(least, most);
  for (float& value : map.values) value = random() % 9 == 0 ? render::kUnknownDepth : depth(random);
  return map;
}

struct TransferredPoint {
  double u = 0, v = 0, w = 0, inverse_depth = 0;
  bool inside = false;
};
inline TransferredPoint transfer_point(const render::PixelTransfer& t, double x, double y,
                                       double q) {
  const auto part = [&](std::size_t r) {
    return t.direction[3 * r] * x + t.direction[3 * r + 1] * y + t.direction[3 * r + 2] +
           q * t.parallax[r];
  };
  const double w = part(2);
  TransferredPoint place{part(0) / w, part(1) / w, w, q / w, false};
  place.inside = w > 0 && place.u >= 0 && place.v >= 0 && place.u <= kWidth && place.v <= kHeight;
  return place;
}

inline double bilinear(double u, double v, const std::function<double(int, int)>& at) {
  const double x = std::clamp(u - 0.5, 0.0, kWidth - 1.0);
  const double y = std::clamp(v - 0.5, 0.0, kHeight - 1.0);
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const int x1 = std::min(x0 + 1, kWidth - 1), y1 = std::min(y0 + 1, kHeight - 1);
  const double right = x - x0, down = y - y0;
  return (1 - down) * ((1 - right) * at(x0, y0) + right * at(x1, y0)) +
         down * ((1 - right) * at(x0, y1) + right * at(x1, y1));
}
inline double luma_at(const render::MatchingImage& image, double u, double v) {
  const int left = static_cast<int>(std::clamp(u - 0.5, 0.0, kWidth - 1.0));
  const int top = static_cast<int>(std::clamp(v - 0.5, 0.0, kHeight - 1.0));
  const std::uint32_t word = image.words()[top * kWidth + left];
  return bilinear(u, v, [&](int x, int y) {
    return static_cast<double>(word >> (8 * (x - left) + 16 * (y - top)) & 0xFFU);
  });
}
/// Returns whether an image is known at a position; nullopt if rounding decides.
inline std::optional<bool> is_known(const render::MatchingImage& image,
                                    const TransferredPoint& place) {
  int known = 0;
  for (int i = 0; i < 4; ++i) {
    const double u = place.u + (i % 2 == 0 ? -1e-3 : 1e-3), v = place.v + (i < 2 ? -1e-3 : 1e-3);
    const bool is_inside = place.w > 0 && u >= 0 && v >= 0 && u <= kWidth && v <= kHeight;
    known += is_inside && image.is_known(static_cast<int>(std::clamp(u - 0.5, 0.0, kWidth - 1.0)),
                                         static_cast<int>(std::clamp(v - 0.5, 0.0, kHeight - 1.0)));
  }
  if (known % 4 != 0) return std::nullopt;
  return known == 4;
}

class DepthKernelsTest : public ::testing::Test {
 protected:
  DepthKernelsTest() {
    for (std::size_t i = 0; i < kPartners; ++i) {
      const auto n = static_cast<double>(i);
      others_.push_back(camera_at({0.1 * n - 0.25, 0.03 * n - 0.1, 0.01 * n}, 0.02 * n - 0.05));
      images_.push_back(random_image(static_cast<unsigned>(i) + 1, others_.back(), 0.3 * n));
      depths_.push_back(random_depths(static_cast<unsigned>(i) + 20, 0.1F, 0.5F));
    }
    for (std::size_t i = 0; i < kPartners; ++i) {
      partners_.push_back({render::pixel_transfer(others_[i], own_), &images_[i], &depths_[i]});
    }
  }
  static constexpr std::size_t kPartners = 6;
  render::VirtualCamera own_ = camera_at({0, 0, 0}, 0);
  render::MatchingImage image_ = random_image(0, own_, 0.5);
  std::vector<render::VirtualCamera> others_;
  std::vector<render::MatchingImage> images_;
  std::vector<render::InverseDepthMap> depths_;
  std::vector<render::NeighbourView> partners_;
};

}  // namespace raystage::testing
