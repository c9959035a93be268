// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "matching/matching.h"
#include "render/common/blending_field.h"
#include "render/sampling/depth_sampling.h"
#include "render/sweep/matching_frame.h"

namespace raystage::render {

struct MatchingCamera {
  DepthSource source;
  const MatchingFrame* frame = nullptr;
};

/// A run of pixels of one row that are matched with the same cameras.
struct CostRun {
  int begin = 0, end = 0, y = 0;
  std::span<const MatchingCamera* const> cameras;  ///< at most kMaxMatchedCameras
  SweepPlanes planes;
  double truncation = 40;         ///< largest difference that counts, codes, 1 to 255
  int excluded_cameras = 0;       ///< cameras per point; see compute_matching_costs()
  std::uint8_t* costs = nullptr;  ///< of the first pixel; plane_stride() bytes per pixel
};

inline constexpr int kMaxMatchedCameras = 16;
/// Pixels per block; longer runs are split from their first pixel on.
inline constexpr int kCostBlockSize = 32;

/// Positions of a block's pixels in a camera, per plane: c0 + x (c1 + x c2), x pixels into the
/// block. A block has parts of a vector's pixels; values per part are `stride` apart.
struct BlockPositions {
  std::array<float*, 3> u{}, v{};  ///< per plane, units of 1/256 and 1/4096 pixel; v: c0 per part
  std::int32_t* fitted = nullptr;  ///< per plane; 0: the parabola does not fit or leaves the frame
  /// Per part: its first column; 4 times its first row, which v is relative to, plus the number of
  /// further rows (2 for any larger number).
  std::int32_t *column = nullptr, *row = nullptr;
  std::ptrdiff_t stride = 0;
};

/// Working memory of compute_matching_costs(); one per thread.
class CostScratch {
 public:
  CostScratch(int planes, int cameras);  ///< `cameras`: the largest number per run

  BlockPositions positions(int camera) {
    const auto i = static_cast<std::size_t>(camera);
    const auto part = [&](std::size_t c) {
      return &coefficients_[((5 + kMaxParts) * i + c) * stride_];
    };
    return {{part(0), part(1), part(2)},     {part(5), part(3), part(4)},
            &fitted_[i * stride_],           &columns_[i * kMaxParts * stride_],
            &rows_[i * kMaxParts * stride_], static_cast<std::ptrdiff_t>(stride_)};
  }
  std::uint8_t* costs() { return costs_.data(); }  ///< kCostBlockSize per plane
  const std::uint8_t* costs() const { return costs_.data(); }

 private:
  static constexpr std::size_t kMaxParts = kCostBlockSize / 4;

  std::size_t stride_;
  std::vector<float> coefficients_;
  std::vector<std::int32_t> fitted_, columns_, rows_;
  std::vector<std::uint8_t> costs_;
};

/// Writes matching costs: for each point the mean, over the cameras that see it, of the absolute
/// differences (mean of R, G, B) from their mean colour. Differences are limited to the truncation,
/// which becomes 255: one outlier among many cameras costs little. Samples are bilinear at
/// positions that are exact to 1/256 pixel.
///
/// Against occlusion, `excluded_cameras` times the camera farthest from the mean of the remaining
/// ones is excluded, while more than two remain; of equals the first. The method follows Kang,
/// Szeliski and Chai 2001 ("Handling occlusions in dense multi-view stereo").
void compute_matching_costs(const CostRun& run, CostScratch& scratch);

/// Input of matching_cost_reference(), the reference of compute_matching_costs() for one point.
/// `ray`: in the world, scaled to planar depth 1.
struct ReferenceCamera {
  const rig::Rig::Camera* camera = nullptr;
  const store::DecodedFrame* frame = nullptr;
};
double matching_cost_reference(std::span<const ReferenceCamera> cameras,
                               const store::CodeScale& scale, const Eigen::Vector3d& eye,
                               const Eigen::Vector3d& ray, double inverse_depth, double truncation,
                               int excluded_cameras = 0);

const char* cost_kernel_target();  ///< returns the name of the instruction set in use

}  // namespace raystage::render
