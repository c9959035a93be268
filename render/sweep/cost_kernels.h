// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "render/sampling/depth_sampling.h"
#include "render/sweep/camera_field.h"
#include "store/frames/frame_cache.h"

namespace raystage {

/// A frame as it is matched: 8-bit codes, R lowest, X = 255; its last column and row twice, so that
/// the four neighbours of any position may be read.
class MatchingFrame {
 public:
  MatchingFrame() = default;
  /// Codes are brought to sRGB's curve if they are linear.
  MatchingFrame(const DecodedFrame& frame, BlendSpace space);

  const std::uint32_t* pixels() const { return pixels_.data(); }
  std::ptrdiff_t pitch() const { return pitch_; }  ///< pixels
  static std::size_t bytes(int width, int height);

 private:
  std::ptrdiff_t pitch_ = 0;
  std::vector<std::uint32_t> pixels_;
};

/// A camera that takes part in the matching.
struct MatchingCamera {
  DepthSource source;
  const std::uint32_t* pixels = nullptr;
  std::ptrdiff_t pitch = 0;
};

/// A run of pixels of one row whose costs come from the same cameras.
struct CostRun {
  int begin = 0, end = 0, y = 0;
  std::span<const MatchingCamera* const> cameras;  ///< kMostMatched at most
  SweepPlanes planes;
  double truncation = 40;         ///< codes, 1 to 255
  std::uint8_t* costs = nullptr;  ///< of the first pixel; plane_stride() bytes a pixel
};

inline constexpr int kMostMatched = 16;
/// Where fewer than two cameras see a point, nothing can be said: half of the truncation.
inline constexpr std::uint8_t kUnknownCost = 127;

/// What fill_costs() works in; one a thread.
class CostScratch {
 public:
  explicit CostScratch(int planes);

  struct Camera {
    std::uint32_t *red_blue, *green, *seen;
  };
  Camera camera(int i);
  std::int32_t* offsets() { return offsets_.data(); }
  std::uint32_t* right() { return right_.data(); }
  std::uint32_t* down() { return down_.data(); }
  std::uint32_t* upper() { return upper_.data(); }  ///< two a plane
  std::uint32_t* lower() { return lower_.data(); }

 private:
  std::size_t stride_;
  std::vector<std::uint32_t> samples_, right_, down_, upper_, lower_;
  std::vector<std::int32_t> offsets_;
};

/// How badly the cameras that see a point agree on its colour: the mean over them of the absolute
/// differences (mean of R, G, B) from their mean colour, each cut off at the truncation; the
/// truncation becomes 255, so one camera's whole disagreement among many stays small. Bilinear.
void fill_costs(const CostRun& run, CostScratch& scratch);

/// The slow, obvious one, of one point: `ray` in the world, scaled to planar depth 1.
struct ReferenceCamera {
  const Rig::Camera* camera = nullptr;
  const DecodedFrame* frame = nullptr;
};
double cost_reference(std::span<const ReferenceCamera> cameras, BlendSpace space,
                      const Eigen::Vector3d& eye, const Eigen::Vector3d& ray, double inverse_depth,
                      double truncation);

/// The instruction set in use.
const char* sweep_target();

}  // namespace raystage
