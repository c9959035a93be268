// SPDX-License-Identifier: Apache-2.0
// Resamples a frame without lens distortion: each pixel of the pinhole is projected through the
// lens model and interpolated by Catmull-Rom splines over 4 x 4 codes. Cost: O(pixels).
#include "evaluation/undistorted_ground_truth.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"

namespace raystage::evaluation {
namespace {

/// Returns the weights of four samples for a position `t` (0 to 1) from the second to the third.
std::array<double, 4> catmull_rom(double t) {
  return {((2 - t) * t - 1) * t / 2, ((3 * t - 5) * t * t + 2) / 2, ((4 - 3 * t) * t + 1) * t / 2,
          (t - 1) * t * t / 2};
}

/// Samples at a pixel position within the frame; border pixels are repeated outwards.
void sample(const store::RgbImage& frame, const Eigen::Vector2d& at, std::uint8_t* rgb) {
  const double left = std::floor(at.x() - 0.5), top = std::floor(at.y() - 0.5);
  const auto across = catmull_rom(at.x() - 0.5 - left), down = catmull_rom(at.y() - 0.5 - top);
  std::array<double, 3> sum{};
  for (std::size_t j = 0; j < 4; ++j) {
    const int y = std::clamp(static_cast<int>(top) + static_cast<int>(j) - 1, 0, frame.height - 1);
    for (std::size_t i = 0; i < 4; ++i) {
      const int x =
          std::clamp(static_cast<int>(left) + static_cast<int>(i) - 1, 0, frame.width - 1);
      const std::size_t from = 3 * (static_cast<std::size_t>(y) * frame.width + x);
      for (std::size_t c = 0; c < 3; ++c) sum[c] += down[j] * across[i] * frame.values[from + c];
    }
  }
  for (std::size_t c = 0; c < 3; ++c) {
    rgb[c] = static_cast<std::uint8_t>(std::lround(std::clamp(sum[c], 0.0, 255.0)));
  }
}

/// Interpolates the light of a frame bilinearly.
void sample_light(std::span<const float> light, int width, int height, const Eigen::Vector2d& at,
                  float* rgb) {
  const double x = std::clamp(at.x() - 0.5, 0.0, width - 1.0);
  const double y = std::clamp(at.y() - 0.5, 0.0, height - 1.0);
  const auto left = static_cast<std::size_t>(x), top = static_cast<std::size_t>(y);
  const std::size_t right = std::min<std::size_t>(left + 1, width - 1);
  const std::size_t below = std::min<std::size_t>(top + 1, height - 1);
  const double u = x - static_cast<double>(left), v = y - static_cast<double>(top);
  for (std::size_t c = 0; c < 3; ++c) {
    const auto of = [&](std::size_t column, std::size_t row) {
      return double{light[3 * (row * static_cast<std::size_t>(width) + column) + c]};
    };
    rgb[c] = static_cast<float>(std::lerp(std::lerp(of(left, top), of(right, top), u),
                                          std::lerp(of(left, below), of(right, below), u), v));
  }
}

}  // namespace

GroundTruth undistorted_ground_truth(const store::RgbImage& frame, const rig::CameraModel& model,
                                     const render::VirtualCamera& pinhole,
                                     std::span<const float> light) {
  const auto width = static_cast<std::size_t>(pinhole.width);
  const std::size_t pixels = width * pinhole.height;
  GroundTruth truth{{pinhole.width, pinhole.height}, {}};
  truth.known.resize(pixels);
  if (!light.empty()) truth.light.resize(3 * pixels);
  const schemas::Intrinsics& k = pinhole.intrinsics;
  raystage::parallel_for(0, pinhole.height, [&](int y) {
    for (int x = 0; x < pinhole.width; ++x) {
      const auto pixel = model.pixel_from_ideal({(x + 0.5 - k.cx) / k.fx, (y + 0.5 - k.cy) / k.fy});
      if (!pixel || !model.contains(*pixel)) continue;
      const std::size_t at = static_cast<std::size_t>(y) * width + x;
      truth.known[at] = 1;
      sample(frame, *pixel, &truth.image.values[3 * at]);
      if (light.empty()) continue;
      sample_light(light, frame.width, frame.height, *pixel, &truth.light[3 * at]);
    }
  });
  return truth;
}

}  // namespace raystage::evaluation
