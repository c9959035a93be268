// SPDX-License-Identifier: Apache-2.0
#include "planning/epipolar/slope_search.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "render/depth/inverse_depth_map.h"

namespace raystage::planning {
namespace {

constexpr float kMaxDifference = 20;   // codes; larger ones count as that
constexpr int kWindowRadius = 2;       // pixels
constexpr float kMinStructure = 3;     // codes, mean of the details' size in the window
constexpr float kMaxCost = 0.35F;      // of the best slope, relative to the structure
constexpr float kMaxRatio = 0.7F;      // of the best slope's cost to that of another one
constexpr double kSameSlope = 3;       // hypotheses around the best that are the same slope
constexpr int kSupportRadius = 3;      // pixels
constexpr int kMinSupport = 12;        // pixels around with similar slopes
constexpr double kSimilarSlope = 1.5;  // hypotheses
constexpr float kNotMeasured = std::numeric_limits<float>::quiet_NaN();

/// Adds to `cost` by how much a neighbour's pixels differ from the camera's at an inverse depth.
void add_differences(const DetailImage& from, const DetailImage& to, double inverse_depth,
                     Image<float>& cost) {
  const render::PixelTransfer transfer = render::pixel_transfer(to.camera, from.camera);
  const auto& m = transfer.direction;
  const auto& p = transfer.parallax;
  const auto step_x = static_cast<float>(m[0]), step_y = static_cast<float>(m[3]),
             step_w = static_cast<float>(m[6]);
  for (int y = 0; y < cost.height; ++y) {
    const double v = y + 0.5;
    const auto start_x = static_cast<float>(m[0] / 2 + m[1] * v + m[2] + inverse_depth * p[0]),
               start_y = static_cast<float>(m[3] / 2 + m[4] * v + m[5] + inverse_depth * p[1]),
               start_w = static_cast<float>(m[6] / 2 + m[7] * v + m[8] + inverse_depth * p[2]);
    float* sums = cost.row(y).data();
    const float* details = from.detail.row(y).data();
    for (int x = 0; x < cost.width; ++x) {
      const auto column = static_cast<float>(x);
      const float w = start_w + column * step_w;
      float difference = kMaxDifference;
      if (w > 0) {
        const float seen =
            to.sample((start_x + column * step_x) / w, (start_y + column * step_y) / w);
        const float distance = std::abs(seen - details[x]);
        if (distance < kMaxDifference) difference = distance;  // not if NaN
      }
      sums[x] += difference;
    }
  }
}

/// Returns the mean difference from one side's cameras, over windows.
Image<float> side_cost(std::span<const DetailImage> images, int camera,
                       const std::vector<int>& neighbours, double inverse_depth) {
  const DetailImage& from = images[static_cast<std::size_t>(camera)];
  Image<float> cost(from.detail.width, from.detail.height);
  for (const int other : neighbours) {
    add_differences(from, images[static_cast<std::size_t>(other)], inverse_depth, cost);
  }
  for (float& value : cost.values) value /= static_cast<float>(neighbours.size());
  box_filter(cost, kWindowRadius);
  return cost;
}

/// Returns the cost of an inverse depth for every pixel: of each axis the better side, mean of the
/// axes.
Image<float> slope_cost(std::span<const DetailImage> images, int camera,
                        const EpipolarNeighbours& neighbours, double inverse_depth) {
  Image<float> total;
  int axes = 0;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    Image<float> best;
    for (const std::size_t side : {2 * axis, 2 * axis + 1}) {
      if (neighbours[side].empty()) continue;
      Image<float> cost = side_cost(images, camera, neighbours[side], inverse_depth);
      if (best.values.empty()) {
        best = std::move(cost);
      } else {
        std::ranges::transform(best.values, cost.values, best.values.begin(),
                               [](float a, float b) { return std::min(a, b); });
      }
    }
    if (best.values.empty()) continue;
    ++axes;
    if (total.values.empty()) {
      total = std::move(best);
    } else {
      std::ranges::transform(total.values, best.values, total.values.begin(), std::plus<>());
    }
  }
  for (float& value : total.values) value /= static_cast<float>(std::max(1, axes));
  return total;
}

/// Returns how much structure the picture has around each pixel, in codes.
Image<float> structure_of(const DetailImage& image) {
  Image<float> structure(image.detail.width, image.detail.height);
  for (std::size_t i = 0; i < structure.values.size(); ++i) {
    const float size = std::abs(image.detail.values[i]);
    structure.values[i] = size < 255 ? size : 0;
  }
  box_filter(structure, kWindowRadius);
  return structure;
}

/// Returns the hypothesis of a clear minimum of a pixel's costs, or NaN.
float clear_minimum(const std::vector<Image<float>>& costs, std::size_t pixel, float structure) {
  const auto cost = [&](std::size_t i) { return costs[i].values[pixel]; };
  std::size_t best = 0;
  for (std::size_t i = 1; i < costs.size(); ++i) {
    if (cost(i) < cost(best)) best = i;
  }
  // A minimum at an end of the range may be the slope of a line outside of it.
  if (best == 0 || best + 1 == costs.size() || cost(best) > kMaxCost * structure)
    return kNotMeasured;
  for (std::size_t i = 0; i < costs.size(); ++i) {
    const double apart = std::abs(static_cast<double>(i) - static_cast<double>(best));
    if (apart > kSameSlope && cost(i) * kMaxRatio < cost(best)) return kNotMeasured;
  }
  const float before = cost(best - 1), after = cost(best + 1), least = cost(best);
  const float curvature = before + after - 2 * least;
  const float vertex = curvature > 0 ? (before - after) / (2 * curvature) : 0.0F;
  return static_cast<float>(best) + vertex;
}

/// Returns whether enough pixels around have a similar slope.
bool is_supported(const Image<float>& found, int x, int y) {
  int support = 0;
  for (int row = std::max(0, y - kSupportRadius);
       row <= std::min(found.height - 1, y + kSupportRadius); ++row) {
    for (int column = std::max(0, x - kSupportRadius);
         column <= std::min(found.width - 1, x + kSupportRadius); ++column) {
      const double apart = std::abs(static_cast<double>(found.at(column, row) - found.at(x, y)));
      if (apart <= kSimilarSlope) ++support;
    }
  }
  return support >= kMinSupport;
}

/// The map of another camera.
struct OtherMap {
  const MeasuredMap& map;
  render::PixelTransfer transfer;  ///< from the other camera

  /// Returns whether the map has a similar inverse depth where its camera sees the point.
  bool has_similar_depth(const MeasuredPixel& pixel) const {
    const auto& m = transfer.direction;
    const auto& p = transfer.parallax;
    const double u = pixel.x + 0.5, v = pixel.y + 0.5, q = pixel.inverse_depth;
    const double w = m[6] * u + m[7] * v + m[8] + q * p[2];
    if (!(w > 0)) return false;
    const double x = (m[0] * u + m[1] * v + m[2] + q * p[0]) / w;
    const double y = (m[3] * u + m[4] * v + m[5] + q * p[1]) / w;
    const Image<float>& there = map.inverse_depth;
    if (!(x >= 1 && y >= 1 && x < there.width - 1 && y < there.height - 1)) return false;
    for (int row = static_cast<int>(y) - 1; row <= static_cast<int>(y) + 1; ++row) {
      for (int column = static_cast<int>(x) - 1; column <= static_cast<int>(x) + 1; ++column) {
        const double apart = std::abs(static_cast<double>(there.at(column, row)) - q / w);
        if (apart <= kSimilarSlope * map.step) return true;
      }
    }
    return false;
  }
};

}  // namespace

EpipolarNeighbours epipolar_neighbours(std::span<const render::VirtualCamera> cameras,
                                       std::span<const int> candidates, int camera,
                                       std::size_t count) {
  struct Candidate {
    double distance = 0;
    int camera = 0;
  };
  std::array<std::vector<Candidate>, 4> sides;
  const rig::Pose& pose = cameras[static_cast<std::size_t>(camera)].pose;
  for (const int other : candidates) {
    if (other == camera) continue;
    const Eigen::Vector3d offset =
        pose.world_from_camera_rotation.transpose() *
        (cameras[static_cast<std::size_t>(other)].pose.position - pose.position);
    const double x = offset.x(), y = offset.y();
    if (std::abs(y) <= std::abs(x) / 2 && x != 0) {
      sides[x < 0 ? 0 : 1].push_back({offset.norm(), other});
    } else if (std::abs(x) <= std::abs(y) / 2 && y != 0) {
      sides[y < 0 ? 2 : 3].push_back({offset.norm(), other});
    }
  }
  EpipolarNeighbours found;
  for (std::size_t side = 0; side < sides.size(); ++side) {
    std::ranges::sort(sides[side], {}, &Candidate::distance);
    for (const Candidate& candidate : sides[side]) {
      if (found[side].size() == count) break;
      found[side].push_back(candidate.camera);
    }
  }
  return found;
}

MeasuredMap search_slopes(std::span<const DetailImage> images, int camera,
                          const EpipolarNeighbours& neighbours, const SlopeHypotheses& range) {
  const DetailImage& from = images[static_cast<std::size_t>(camera)];
  const bool is_alone = std::ranges::all_of(neighbours, &std::vector<int>::empty);
  if (is_alone || range.count < 2) return {from.camera, {}, 0};
  std::vector<Image<float>> costs;
  for (int i = 0; i < range.count; ++i) {
    costs.push_back(slope_cost(images, camera, neighbours, range.at(i)));
  }
  const Image<float> structure = structure_of(from);
  Image<float> found(structure.width, structure.height, kNotMeasured);
  for (std::size_t i = 0; i < structure.values.size(); ++i) {
    if (structure.values[i] < kMinStructure) continue;
    found.values[i] = clear_minimum(costs, i, structure.values[i]);
  }
  MeasuredMap measured{from.camera, Image<float>(found.width, found.height, kNotMeasured),
                       range.step()};
  for (int y = 0; y < found.height; ++y) {
    for (int x = 0; x < found.width; ++x) {
      if (std::isnan(found.at(x, y)) || !is_supported(found, x, y)) continue;
      measured.inverse_depth.at(x, y) =
          static_cast<float>(range.at(static_cast<double>(found.at(x, y))));
    }
  }
  return measured;
}

std::vector<MeasuredPixel> confirmed_pixels(const MeasuredMap& map,
                                            std::span<const MeasuredMap> maps) {
  std::vector<MeasuredPixel> confirmed;
  std::vector<OtherMap> others;
  for (const MeasuredMap& other : maps) {
    if (&other == &map || other.inverse_depth.values.empty()) continue;
    others.push_back({other, render::pixel_transfer(other.camera, map.camera)});
  }
  for (int y = 0; y < map.inverse_depth.height; ++y) {
    for (int x = 0; x < map.inverse_depth.width; ++x) {
      const MeasuredPixel pixel{x, y, static_cast<double>(map.inverse_depth.at(x, y))};
      if (std::isnan(pixel.inverse_depth)) continue;
      if (std::ranges::any_of(
              others, [&](const OtherMap& other) { return other.has_similar_depth(pixel); })) {
        confirmed.push_back(pixel);
      }
    }
  }
  return confirmed;
}

}  // namespace raystage::planning
