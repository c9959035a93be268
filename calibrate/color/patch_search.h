// SPDX-License-Identifier: Apache-2.0
// Inside calibrate only: how find_scene_patches() finds one patch.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "calibrate/color/scene_patches.h"
#include "rig/photometric_model.h"
#include "store/processing/frames/photometric_correction.h"

namespace raystage {

/// What a camera shows, ready to be compared.
struct PatchSearchImage {
  int camera = -1;
  PictureSize size;
  std::vector<std::array<float, 4>> light;      ///< R, G, B and the root of their luminance
  std::array<float, 3> darkest{}, brightest{};  ///< beyond which codes say too little

  /// Bilinear between pixel centres; (x, y) in pixels from the picture's top-left corner, half a
  /// pixel within it at least.
  std::array<float, 4> at(const Eigen::Vector2d& pixel) const;
};

/// `levels`: of linear light. Throws Error (bad input) for a damaged frame or one whose size is not
/// the rig's.
PatchSearchImage load_patch_search_image(const Take& take, const Rig& rig, int camera, int frame,
                                         const LevelTable& levels);

/// Surfaces across the array's viewing direction, evenly spaced in 1 / depth so that from one to
/// the next a patch moves by three quarters of a pixel in the camera that sees it move most.
class InverseDepthSteps {
 public:
  static constexpr double kStepPx = 0.75;

  /// Between `base` and `others`, indices of the rig's cameras.
  InverseDepthSteps(const Rig& rig, const DepthRange& range, int base,
                    const std::vector<int>& others);

  /// Steps of depths that are looked at: [0, count()) from far to near; of these the scene's are
  /// [first(), last()], the others show what lies beyond.
  int count() const { return count_; }
  int first() const { return first_; }
  int last() const { return last_; }
  /// Where a ray comes to a step's depth (or between two); nowhere where it goes another way.
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

/// Looks for patches of one camera in the cameras around it. What it is given must outlive it.
class PatchSearch {
 public:
  PatchSearch(const Rig& rig, const PatchSearchSettings& settings, const PatchSearchImage& base,
              const std::vector<PatchSearchImage>& others);

  /// The patch about a pixel, in as many cameras as show it.
  std::optional<ScenePatch> find(const Eigen::Vector2d& middle) const;

 private:
  struct Patch;
  struct Rays;
  const Rig::Camera& camera(const PatchSearchImage& shown) const {
    return rig_.cameras[static_cast<std::size_t>(shown.camera)];
  }
  std::optional<Patch> match_patch(const PatchSearchImage& other, const Rays& rays, double step,
                                   Eigen::Vector2d& middle) const;
  double depth_score(const Patch& patch, const Rays& rays, double step) const;
  std::optional<double> best_step(const Patch& patch, const Rays& rays) const;
  std::optional<ScenePatch> point_at(const Patch& patch, const Rays& rays,
                                     const Eigen::Vector2d& middle, double step) const;

  const Rig& rig_;
  const PatchSearchSettings& settings_;
  const PatchSearchImage& base_;
  const std::vector<PatchSearchImage>& others_;
  InverseDepthSteps steps_;
};

}  // namespace raystage
