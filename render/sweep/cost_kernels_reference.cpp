// SPDX-License-Identifier: Apache-2.0
// Reference of compute_matching_costs() (cost_kernels.cpp) for one point of a ray, in double. Takes
// bilinear 8-bit codes of each camera that sees the point. The cost is the mean truncated
// difference from the mean colour, without the worst `excluded_cameras`. Output: 0 to 255, 255 =
// truncation. Cost: O(cameras).
#include <algorithm>
#include <array>
#include <cmath>

#include "base/transfer_function.h"
#include "render/sweep/cost_kernels.h"
#include "store/processing/frames/matching_code.h"

namespace raystage::render {
namespace {

/// Returns an 8-bit code of the sRGB curve.
double code(const store::DecodedFrame& frame, const store::CodeScale& scale, int x, int y,
            std::size_t c) {
  const auto column = static_cast<std::size_t>(std::min(x, frame.width - 1));
  const auto row = static_cast<std::size_t>(std::min(y, frame.height - 1));
  const std::uint16_t stored =
      frame.rgba[(row * static_cast<std::size_t>(frame.width) + column) * 4 + c];
  if (scale.space == store::BlendSpace::kPerceptual) return stored >> 8;
  const double part = store::part_from_value(scale.space, stored / 65535.0);
  const double shown = scale.space == store::BlendSpace::kHighRange
                           ? store::matching_code(scale, part * scale.full_scale)
                           : srgb_from_linear(part);
  return std::floor(shown * 255 + 0.5);
}

using Colour = std::array<double, 3>;

Colour mean_of(const std::vector<Colour>& colours) {
  Colour mean{};
  for (const Colour& colour : colours) {
    for (std::size_t c = 0; c < 3; ++c) mean[c] += colour[c] / static_cast<double>(colours.size());
  }
  return mean;
}
/// Returns the mean of the differences of three channels.
double off(const Colour& a, const Colour& b) {
  double sum = 0;
  for (std::size_t c = 0; c < 3; ++c) sum += std::abs(a[c] - b[c]) / 3;
  return sum;
}

}  // namespace

double matching_cost_reference(std::span<const ReferenceCamera> cameras,
                               const store::CodeScale& scale, const Eigen::Vector3d& eye,
                               const Eigen::Vector3d& ray, double inverse_depth, double truncation,
                               int excluded_cameras) {
  std::vector<Colour> colours;
  for (const ReferenceCamera& camera : cameras) {
    const store::DecodedFrame& frame = *camera.frame;
    const DepthSample at = sample_at_depth_reference(eye, ray, inverse_depth, *camera.camera, frame,
                                                     Interpolation::kLinear);
    if (at.seen <= 0) continue;
    const double left = std::clamp(at.u - 0.5, 0.0, frame.width - 1.0);
    const double top = std::clamp(at.v - 0.5, 0.0, frame.height - 1.0);
    const int x = static_cast<int>(left), y = static_cast<int>(top);
    Colour colour;
    for (std::size_t c = 0; c < 3; ++c) {
      const auto row = [&](int of) {
        return std::lerp(code(frame, scale, x, of, c), code(frame, scale, x + 1, of, c), left - x);
      };
      colour[c] = std::lerp(row(y), row(y + 1), top - y);
    }
    colours.push_back(colour);
  }
  if (colours.size() < 2) return matching::kUnknownCost;
  for (int i = 0; i < excluded_cameras && colours.size() > 2; ++i) {
    const Colour mean = mean_of(colours);
    colours.erase(std::ranges::max_element(
        colours, {}, [&](const Colour& colour) { return off(colour, mean); }));
  }
  const Colour mean = mean_of(colours);
  double sum = 0;
  for (const Colour& colour : colours) sum += std::min(off(colour, mean), truncation);
  return sum / static_cast<double>(colours.size()) * 255 / truncation;
}

}  // namespace raystage::render
