// SPDX-License-Identifier: Apache-2.0
// Internal to calibrate: joint least squares over contrast and brightness of cameras and the light
// of points.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <stop_token>
#include <vector>

#include "calibrate/color/scene_patches.h"
#include "rig/photometric_model.h"

namespace raystage::calibrate {

class SceneFit {
 public:
  /// Parameters of one camera: 1 / contrast of R, G, B, then brightness of R, G, B.
  using CameraParameters = std::array<double, 6>;
  struct Observation {
    std::size_t point = 0, camera = 0;
    schemas::Rgb measured{}, gain{}, deviation{};
    bool counts = true;
  };

  /// Keeps a reference to `rig`.
  SceneFit(std::span<const ScenePatch> points, const rig::Rig& rig, std::size_t reference);

  std::vector<Observation>& observations() { return observations_; }
  const std::vector<Observation>& observations() const { return observations_; }
  std::size_t points() const { return light_.size(); }
  const std::vector<CameraParameters>& cameras() const { return cameras_; }
  const std::vector<CameraParameters>& start() const { return start_; }  ///< those of the rig

  /// Returns the linear light (full scale 1) of the point that an observation implies.
  schemas::Rgb estimated_light(const Observation& observation,
                               const CameraParameters& camera) const;
  /// Returns the largest residual of an observation over the channels, in standard deviations.
  double normalised_residual(const Observation& observation) const;

  /// Fits cameras and light to the observations that are used, of the points with `counts(point)`.
  /// `scale`: scale of Cauchy's loss, in standard deviations. Throws Error (failed) if a stop is
  /// requested.
  void solve(double scale, const std::function<bool(std::size_t)>& counts,
             const std::stop_token& stop);

  /// Returns two standard deviations of each camera's measured light, relative: the maximum over
  /// its channels and over a tenth and half of full scale. Computed from the covariance of the
  /// solution, with noise estimated from the residuals and points as free parameters. The prior on
  /// small brightness is not included. 0 for the reference camera; a large number for undetermined
  /// cameras. `scale`: as in solve().
  std::vector<double> uncertainty(double scale) const;

 private:
  std::vector<schemas::Rgb> mean_lights() const;

  const rig::Rig& rig_;
  std::size_t reference_;
  std::vector<Observation> observations_;
  std::vector<schemas::ColorMatrix> unmix_;
  std::vector<CameraParameters> cameras_, start_;
  std::vector<schemas::Rgb> light_;  ///< of each point
};

}  // namespace raystage::calibrate
