// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "render/common/blending_field.h"
#include "render/matching/matching.h"
#include "render/sampling/depth_sampling.h"
#include "render/sweep/matching_frame.h"

namespace raystage {

/// A camera that takes part in the matching.
struct MatchingCamera {
  DepthSource source;
  const MatchingFrame* frame = nullptr;
};

/// A run of pixels of one row whose costs come from the same cameras.
struct CostRun {
  int begin = 0, end = 0, y = 0;
  std::span<const MatchingCamera* const> cameras;  ///< kMaxMatchedCameras at most
  SweepPlanes planes;
  double truncation = 40;         ///< codes, 1 to 255
  int excluded_cameras = 0;       ///< cameras at each point, see compute_matching_costs()
  std::uint8_t* costs = nullptr;  ///< of the first pixel; plane_stride() bytes a pixel
};

inline constexpr int kMaxMatchedCameras = 16;
/// Pixels per block: longer runs are split from their first pixel on.
inline constexpr int kCostBlockSize = 32;

/// Where a camera sees the pixels of a block, plane by plane: c0 + x (c1 + x c2), x pixels into the
/// block. A block has parts, as many pixels as a vector holds; where something is told part by
/// part, the next part's is `stride` on.
struct BlockPositions {
  std::array<float*, 3> u{}, v{};  ///< one a plane; 1/256 and 1/4096 pixel; v's c0 of each part
  std::int32_t* even = nullptr;    ///< not 0: that is so, and all lies within the frame
  /// Of each part: its least column; its least row, which v is told from, times 4, and by how many
  /// rows others are further down: 2 for any more.
  std::int32_t *column = nullptr, *row = nullptr;
  std::ptrdiff_t stride = 0;
};

/// Working memory of compute_matching_costs(); one per thread.
class CostScratch {
 public:
  /// For runs of so many cameras at most.
  CostScratch(int planes, int cameras);

  BlockPositions positions(int camera) {
    const auto i = static_cast<std::size_t>(camera);
    const auto part = [&](std::size_t c) {
      return &coefficients_[((5 + kMaxParts) * i + c) * stride_];
    };
    return {{part(0), part(1), part(2)},
            {part(5), part(3), part(4)},
            &even_[i * stride_],
            &columns_[i * kMaxParts * stride_],
            &rows_[i * kMaxParts * stride_],
            static_cast<std::ptrdiff_t>(stride_)};
  }
  std::uint8_t* costs() { return costs_.data(); }  ///< kCostBlockSize a plane
  const std::uint8_t* costs() const { return costs_.data(); }

 private:
  static constexpr std::size_t kMaxParts = kCostBlockSize / 4;

  std::size_t stride_;
  std::vector<float> coefficients_;
  std::vector<std::int32_t> even_, columns_, rows_;
  std::vector<std::uint8_t> costs_;
};

/// Writes matching costs: for each point the mean over the cameras that see it of the absolute
/// differences (mean of R, G, B) from their mean colour, each cut off at the truncation; the
/// truncation becomes 255, so one camera's whole disagreement among many stays small. Bilinear,
/// at positions that are exact to 1/256 pixel.
///
/// Against occlusion, after Kang, Szeliski and Chai 2001 ("Handling occlusions in dense multi-view
/// stereo"): `excluded_cameras` times the camera that is farthest from the mean of those that still
/// count is left out, the first of equals, as long as more than two count.
void compute_matching_costs(const CostRun& run, CostScratch& scratch);

/// The reference of compute_matching_costs() for one point: `ray` in the world, scaled to planar
/// depth 1.
struct ReferenceCamera {
  const Rig::Camera* camera = nullptr;
  const DecodedFrame* frame = nullptr;
};
double matching_cost_reference(std::span<const ReferenceCamera> cameras, BlendSpace space,
                               const Eigen::Vector3d& eye, const Eigen::Vector3d& ray,
                               double inverse_depth, double truncation, int excluded_cameras = 0);

/// The instruction set in use.
const char* cost_kernel_target();

}  // namespace raystage
