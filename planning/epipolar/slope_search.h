// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <vector>

#include "planning/epipolar/detail_image.h"

namespace raystage::planning {

/// The cameras next to one in its row and its column, nearest first: left, right, below, above.
/// Empty where there are none.
using EpipolarNeighbours = std::array<std::vector<int>, 4>;

/// Returns the neighbours of a camera along its x and y axes, at most `count` each: those that are
/// at most half as far from the axis as along it, among `candidates`.
EpipolarNeighbours epipolar_neighbours(std::span<const render::VirtualCamera> cameras,
                                       std::span<const int> candidates, int camera,
                                       std::size_t count);

/// Inverse planar depths (1/m) at which lines are searched for in epipolar-plane images.
struct SlopeHypotheses {
  double farthest = 0, nearest = 0;
  int count = 2;  ///< hypotheses, evenly spaced, with both ends; at least 2

  double step() const { return (nearest - farthest) / (count - 1); }
  double at(double hypothesis) const { return farthest + hypothesis * step(); }
};

/// The inverse depths of a camera that were measured.
struct MeasuredMap {
  render::VirtualCamera camera;  ///< without distortion, in the size of `inverse_depth`
  Image<float> inverse_depth;    ///< planar, 1/m; NaN where none was measured; may be empty
  double step = 0;               ///< between hypotheses, 1/m
};

/// A pixel whose inverse depth was measured.
struct MeasuredPixel {
  int x = 0, y = 0;
  double inverse_depth = 0;  ///< planar, 1/m
};

/// Measures the pixels of a camera that lie on clear lines of the epipolar-plane images through
/// its row and its column (Bolles, Baker and Marimont, "Epipolar-plane image analysis", IJCV 1,
/// 1987; thesis 5.1.2). A point at inverse depth q is a line; along the right one the pixels of
/// all cameras are alike. Of the cameras to the left and to the right the more alike side counts,
/// because a nearer surface may hide the point from the other; in the same way for the column.
/// A line is clear if the picture has structure there, no other slope explains it nearly as well,
/// and the pixels around it have similar slopes.
/// `images`: by camera. Memory: 4 bytes for each pixel and hypothesis.
MeasuredMap search_slopes(std::span<const DetailImage> images, int camera,
                          const EpipolarNeighbours& neighbours, const SlopeHypotheses& range);

/// Returns the pixels of a map that another map confirms: it has a similar inverse depth where it
/// sees the point. Repeated patterns deceive cameras in different ways.
std::vector<MeasuredPixel> confirmed_pixels(const MeasuredMap& map,
                                            std::span<const MeasuredMap> maps);

}  // namespace raystage::planning
