// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include "render/sweep/cost_kernels.h"
#include "schemas/transfer_function.h"

namespace raystage {
namespace {

/// 8-bit code, as matched.
double code(const DecodedFrame& frame, BlendSpace space, int x, int y, std::size_t c) {
  const auto column = static_cast<std::size_t>(std::min(x, frame.width - 1));
  const auto row = static_cast<std::size_t>(std::min(y, frame.height - 1));
  const std::uint16_t stored =
      frame.rgbx[(row * static_cast<std::size_t>(frame.width) + column) * 4 + c];
  if (space == BlendSpace::kPerceptual) return stored >> 8;
  return std::floor(srgb_from_linear(stored / 65535.0) * 255 + 0.5);
}

}  // namespace

double cost_reference(std::span<const ReferenceCamera> cameras, BlendSpace space,
                      const Eigen::Vector3d& eye, const Eigen::Vector3d& ray, double inverse_depth,
                      double truncation) {
  std::vector<std::array<double, 3>> colours;
  for (const ReferenceCamera& camera : cameras) {
    const DecodedFrame& frame = *camera.frame;
    const DepthSample at =
        sample_at_depth_reference(eye, ray, inverse_depth, *camera.camera, frame, LookUp::kLinear);
    if (at.seen <= 0) continue;
    const double left = std::clamp(at.u - 0.5, 0.0, frame.width - 1.0);
    const double top = std::clamp(at.v - 0.5, 0.0, frame.height - 1.0);
    const int x = static_cast<int>(left), y = static_cast<int>(top);
    std::array<double, 3> colour;
    for (std::size_t c = 0; c < 3; ++c) {
      const auto row = [&](int of) {
        return std::lerp(code(frame, space, x, of, c), code(frame, space, x + 1, of, c), left - x);
      };
      colour[c] = std::lerp(row(y), row(y + 1), top - y);
    }
    colours.push_back(colour);
  }
  if (colours.size() < 2) return kUnknownCost;
  std::array<double, 3> mean{};
  const auto n = static_cast<double>(colours.size());
  for (const auto& colour : colours) {
    for (std::size_t c = 0; c < 3; ++c) mean[c] += colour[c] / n;
  }
  double sum = 0;
  for (const auto& colour : colours) {
    double off = 0;
    for (std::size_t c = 0; c < 3; ++c) off += std::abs(colour[c] - mean[c]) / 3;
    sum += std::min(off, truncation);
  }
  return sum / n * 255 / truncation;
}

}  // namespace raystage
