// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "render/depth/estimation_kernels.h"
#include "render/depth/inverse_depth_map.h"
#include "render/depth/matching_image.h"

namespace raystage::render {

inline constexpr int kMostVectorLanes = 16;  ///< floats that the kernels may read at once

/// Depths and colours of a camera, with `margin` unknown pixels to the left and right of each row,
/// so that vectors may read beyond it.
class BackgroundPlanes {
 public:
  BackgroundPlanes(const InverseDepthMap& map, const MatchingImage& image, int margin);

  /// Replaces the depths.
  void set_depths(const InverseDepthMap& map);

  int width() const { return width_; }
  int height() const { return height_; }
  int margin() const { return margin_; }
  /// Return the first pixel of a row, within its margins.
  const float* depths(int y) const { return depth_.data() + offset(y); }
  /// A colour: luma (lowest byte; 0 = unknown) and MatchingImage::chroma().
  const std::int32_t* colours(int y) const { return colour_.data() + offset(y); }

 private:
  std::size_t offset(int y) const {
    return static_cast<std::size_t>(y) * stride_ + static_cast<std::size_t>(margin_);
  }

  int width_, height_, margin_;
  std::size_t stride_;
  std::vector<float> depth_;
  std::vector<std::int32_t> colour_;
};

/// Opposite directions follow each other.
inline constexpr std::array<std::array<int, 2>, 8> kBackgroundDirections{
    {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, -1}, {1, -1}, {-1, 1}}};

/// A row in which background is searched for.
struct BackgroundRow {
  const BackgroundPlanes* planes = nullptr;
  int y = 0, reach = 0;  ///< pixels along a direction; at most the margin
  float apart = 0;       ///< 1/m by which background is farther, at least
  int same_colour = 0;   ///< codes: largest difference of luma, and of chroma in sum
  /// Per pixel: above 0 where it is searched for. Has kMostVectorLanes more values, which are 0.
  const float* is_active = nullptr;
  /// By direction: inverse depth and distance (steps; 0: none) of the next background, per pixel
  /// and kMostVectorLanes more.
  std::array<float*, kBackgroundDirections.size()> depth{}, distance{};
};
/// Finds, along each direction, the next pixel of the same colour whose depth is known and farther
/// by `apart`. Values of inactive pixels are undefined.
void find_background(const BackgroundRow& row);

/// Points of a row: pixels with depths that may not be theirs.
struct AgreementRow {
  int y = 0;
  const MatchingImage* image = nullptr;            ///< of the camera
  std::span<const NeighbourView> neighbour_views;  ///< kMaxNeighbours at most
  std::span<const std::int32_t> columns;           ///< per point
  std::span<const float> inverse_depth;            ///< per point, 1/m
  float* costs = nullptr;                          ///< per point
};
/// Writes the mean of the smaller half of the luma differences between the camera and the
/// neighbours that see the point, codes; infinite where none does.
void compute_agreement(const AgreementRow& row);

}  // namespace raystage::render
