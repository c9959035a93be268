// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace raystage {
class BufferPool;
}

namespace raystage::matching {

/// The size of a cost volume: one of `planes` hypotheses (depths, disparities) is chosen per pixel.
struct CostVolume {
  int width = 0, height = 0;  ///< pixels, at least 1
  int planes = 0;             ///< at least 1
};

/// Returns the bytes from one pixel's costs to the next's: `planes`, rounded up for the kernels.
int plane_stride(int planes);

/// The cost where it is unknown, as fewer than two cameras see a point: half of the maximum.
inline constexpr std::uint8_t kUnknownCost = 127;

/// Fills row y: the cost of plane d at pixel x is costs[x * plane_stride(planes) + d], from 0
/// (agreement) to 255. Values between `planes` and the stride need not be written. Called from many
/// threads at once, and for some rows twice: it must write the same values each time.
using FillCosts = std::function<void(int y, std::span<std::uint8_t> costs)>;

/// The chosen hypothesis of each pixel, row-major.
struct PlaneMap {
  PlaneMap() = default;
  PlaneMap(int columns, int rows)
      : width(columns),
        height(rows),
        plane(static_cast<std::size_t>(columns) * rows),
        cost(plane.size()) {}

  int width = 0, height = 0;
  std::vector<float> plane;        ///< 0 to planes - 1; fractional with subplane_refinement
  std::vector<std::uint8_t> cost;  ///< the filled-in cost of the nearest integer plane
};

struct SemiGlobalOptions {
  int p1 = 40;   ///< penalty for neighbours one plane apart: 0 to p2
  int p2 = 200;  ///< penalty for larger differences: p1 to 4000
  bool subplane_refinement = true;
  /// The guide image for edges: one byte per pixel, row-major; may be empty. A step in it lowers p2
  /// to p2 / (1 + |step| / guide_scale), but not below p1. Depth steps are thus cheaper at edges of
  /// the image.
  std::span<const std::uint8_t> guide;
  double guide_scale = 10;                           ///< above 0
  std::size_t working_bytes = std::size_t{1} << 30;  ///< see semi_global_match()
  /// Allocates the memory, for callers that match often; null: the system.
  BufferPool* buffers = nullptr;
  bool is_valid(std::string* reason) const;
};

/// Returns, for each pixel, the plane with the least cost by semi-global matching (Hirschmueller
/// 2008). The cost is summed along eight straight paths that end in the pixel, with penalties for
/// changes of plane along them.
///
/// Memory: 3 bytes per pixel and plane where that fits `working_bytes`. Otherwise the image is
/// processed in strips that fit (of at least 16 rows), each of which is filled twice. The result is
/// bit-identical for any memory and number of threads. Where no strips fit, those with the least
/// memory are used. Throws std::logic_error for settings out of range.
PlaneMap semi_global_match(const CostVolume& volume, const FillCosts& fill,
                           const SemiGlobalOptions& options);

/// Returns the memory that semi_global_match() needs in addition to its result for these
/// `working_bytes`.
std::size_t semi_global_bytes(const CostVolume& volume, std::size_t working_bytes);

/// Returns the plane with the least cost, summed over the square of pixels up to `radius` (0 to 7)
/// away and clipped at the image's border. Memory in addition to the result: box_bytes().
PlaneMap box_match(const CostVolume& volume, const FillCosts& fill, int radius,
                   bool subplane_refinement);

/// Returns the memory that box_match() needs in addition to its result on this number of threads: 2
/// radius + 4 rows of the volume each.
std::size_t box_bytes(const CostVolume& volume, int radius, int threads);

/// Return the same as semi_global_match() and box_match(), bit-identical: the references.
PlaneMap semi_global_match_reference(const CostVolume& volume, const FillCosts& fill,
                                     const SemiGlobalOptions& options);
PlaneMap box_match_reference(const CostVolume& volume, const FillCosts& fill, int radius,
                             bool subplane_refinement);

/// Returns the vertex of the parabola through three costs around the minimum, -0.5 to 0.5, or 0 if
/// all are equal. Requires `before`, `after` >= `least`.
inline float parabola_vertex(int before, int least, int after) {
  const int curvature = (before - least) + (after - least);
  return curvature == 0 ? 0.0F
                        : 0.5F * static_cast<float>(before - after) / static_cast<float>(curvature);
}

/// Returns p2 for each size of a step in the guide image (0 to 255); constant without a guide.
std::vector<std::uint16_t> p2_by_guide_step(const SemiGlobalOptions& options);

}  // namespace raystage::matching
