// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace raystage {

class BufferPool;

/// A choice of one of `planes` hypotheses (depths, disparities) per pixel of an image.
struct CostVolume {
  int width = 0, height = 0;  ///< pixels, at least 1
  int planes = 0;             ///< at least 1
};

/// Bytes from one pixel's costs to the next's: `planes`, rounded up for the kernels.
int plane_stride(int planes);

/// The cost where nothing can be said, as fewer than two cameras see a point: half of the most.
inline constexpr std::uint8_t kUnknownCost = 127;

/// Fills row y: the cost of plane d at pixel x goes to costs[x * plane_stride(planes) + d], from 0
/// (agrees) to 255. What is between `planes` and the stride need not be written. Called from many
/// threads at once, and for some rows twice: it must write the same each time.
using FillCosts = std::function<void(int y, std::span<std::uint8_t> costs)>;

/// The hypothesis chosen at each pixel, row-major.
struct PlaneMap {
  int width = 0, height = 0;
  std::vector<float>
      plane;  ///< 0 to planes - 1; in between where subplane_refinement was asked for
  std::vector<std::uint8_t> cost;  ///< as filled in, of the nearest whole plane
};

struct SemiGlobalSettings {
  int p1 = 40;   ///< penalty where neighbours are one plane apart: 0 to p2
  int p2 = 200;  ///< where they are further apart: p1 to 4000
  bool subplane_refinement = true;
  /// A byte per pixel of the image that edges are taken from, row-major; may be empty. A step in it
  /// lowers p2 to p2 / (1 + |step| / guide_scale), never below p1: depth may jump where light does.
  std::span<const std::uint8_t> guide;
  double guide_scale = 10;                           ///< above 0
  std::size_t working_bytes = std::size_t{1} << 30;  ///< see semi_global_match()
  BufferPool* buffers = nullptr;  ///< where its memory comes from, for those who match often
};

/// Semi-global matching (Hirschmueller 2008): the plane of least cost summed along eight straight
/// paths that end in the pixel, with penalties for changes of plane on the way.
///
/// Memory: 3 bytes per pixel and plane where that fits `working_bytes`, else it is done in strips
/// that fit (of 16 rows at least), each filled twice. The result is the same to the bit, however
/// much memory and however many threads there are. Where no strips fit, those that take least are
/// used. Throws std::logic_error for settings out of range.
PlaneMap semi_global_match(const CostVolume& volume, const FillCosts& fill,
                           const SemiGlobalSettings& settings);

/// Memory that it takes beside its result where so much is granted.
std::size_t semi_global_bytes(const CostVolume& volume, std::size_t working_bytes);

/// The plane of least cost summed over the square of pixels up to `radius` (0 to 7) away, cut off
/// at the image's border. Memory beside the result: box_bytes().
PlaneMap box_match(const CostVolume& volume, const FillCosts& fill, int radius,
                   bool subplane_refinement);

/// Memory that box_match() takes beside its result on so many threads: 2 radius + 4 rows of the
/// volume each.
std::size_t box_bytes(const CostVolume& volume, int radius, int threads);

/// The slow, obvious ones: the same to the bit.
PlaneMap semi_global_match_reference(const CostVolume& volume, const FillCosts& fill,
                                     const SemiGlobalSettings& settings);
PlaneMap box_match_reference(const CostVolume& volume, const FillCosts& fill, int radius,
                             bool subplane_refinement);

/// Where the parabola through three costs around the least has its vertex, -0.5 to 0.5; 0 where all
/// are equal. `before`, `after` >= `least`.
inline float parabola_vertex(int before, int least, int after) {
  const int curvature = (before - least) + (after - least);
  return curvature == 0 ? 0.0F
                        : 0.5F * static_cast<float>(before - after) / static_cast<float>(curvature);
}

/// p2 by the size of the guide's step; all the same without a guide.
std::vector<std::uint16_t> p2_by_guide_step(const SemiGlobalSettings& settings);

}  // namespace raystage
