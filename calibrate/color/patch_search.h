// SPDX-License-Identifier: Apache-2.0
// Internal to calibrate: search of one patch for find_scene_patches().
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "base/image.h"
#include "calibrate/color/scene_patches.h"
#include "rig/photometric_model.h"
#include "store/processing/frames/photometric_correction.h"

namespace raystage::calibrate {

/// A frame prepared for comparison.
struct PatchSearchImage {
  int camera = -1;
  Image<std::array<float, 4>> light;            ///< R, G, B and the square root of the luminance
  std::array<float, 3> darkest{}, brightest{};  ///< limits of usable codes

  /// Returns the bilinear sample at (x, y), pixels from the top-left corner, at least half a pixel
  /// inside.
  std::array<float, 4> at(const Eigen::Vector2d& pixel) const;
};

/// Loads a frame. `levels`: linear light by code. Throws Error (bad input) for a damaged frame, or
/// one whose size is not that of the rig.
PatchSearchImage load_patch_search_image(const store::Take& take, const rig::Rig& rig, int camera,
                                         int frame, const store::LevelTable& levels);

/// Depth planes perpendicular to the array's viewing direction, evenly spaced in inverse depth:
/// between adjacent planes a patch moves by at most three quarters of a pixel.
class InverseDepthSteps {
 public:
  static constexpr double kStepPx = 0.75;

  /// Makes the steps for a patch of camera `base` that is compared with `others`; indices of the
  /// rig's cameras.
  InverseDepthSteps(const rig::Rig& rig, const schemas::DepthRange& range, int base,
                    const std::vector<int>& others);

  /// Returns the number of steps; their indices, [0, count()), increase from far to near. Those of
  /// the scene are [first(), last()]; the others detect patches beyond it.
  int count() const { return count_; }
  int first() const { return first_; }
  int last() const { return last_; }
  /// Returns the point of a ray at a (fractional) step's depth; none if the ray does not reach it.
  std::optional<Eigen::Vector3d> point(const Eigen::Vector3d& origin,
                                       const Eigen::Vector3d& direction, double step) const;

 private:
  std::optional<Eigen::Vector3d> point_at(const Eigen::Vector3d& origin,
                                          const Eigen::Vector3d& direction,
                                          double inverse_depth) const;

  Eigen::Vector3d centre_, forward_;
  double farthest_ = 0, step_ = 0;  ///< 1 / metres
  int count_ = 0, first_ = 0, last_ = 0;
};

/// Searches patches of one camera in neighbouring cameras. Refers to its arguments.
class PatchSearch {
 public:
  PatchSearch(const rig::Rig& rig, const PatchSearchOptions& options, const PatchSearchImage& base,
              const std::vector<PatchSearchImage>& others);

  /// Returns the patch around a pixel with all cameras that observe it.
  std::optional<ScenePatch> find(const Eigen::Vector2d& middle) const;

 private:
  struct Patch;
  struct Rays;
  const rig::Rig::Camera& camera(const PatchSearchImage& shown) const {
    return rig_.cameras[shown.camera];
  }
  std::optional<Patch> match_patch(const PatchSearchImage& other, const Rays& rays, double step,
                                   Eigen::Vector2d& middle) const;
  double depth_score(const Patch& patch, const Rays& rays, double step) const;
  std::optional<double> best_step(const Patch& patch, const Rays& rays) const;
  std::optional<ScenePatch> point_at(const Patch& patch, const Rays& rays,
                                     const Eigen::Vector2d& middle, double step) const;

  const rig::Rig& rig_;
  const PatchSearchOptions& options_;
  const PatchSearchImage& base_;
  const std::vector<PatchSearchImage>& others_;
  InverseDepthSteps steps_;
};

}  // namespace raystage::calibrate
