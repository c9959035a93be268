// SPDX-License-Identifier: Apache-2.0
// Inside calibrate only: cameras' contrast and brightness, and the light of points, by each other.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <stop_token>
#include <vector>

#include "calibrate/color/scene_patches.h"
#include "rig/photometric_model.h"

namespace raystage {

class SceneFit {
 public:
  /// One camera's unknowns: 1 / contrast of R, G, B, then brightness.
  using CameraParameters = std::array<double, 6>;
  struct Observation {
    std::size_t point = 0, camera = 0;
    Rgb measured{}, gain{}, deviation{};
    bool counts = true;
  };

  /// `rig` must outlive it.
  SceneFit(std::span<const ScenePatch> points, const Rig& rig, std::size_t reference);

  std::vector<Observation>& observations() { return observations_; }
  const std::vector<Observation>& observations() const { return observations_; }
  std::size_t points() const { return light_.size(); }
  const std::vector<CameraParameters>& cameras() const { return cameras_; }
  const std::vector<CameraParameters>& start() const { return start_; }  ///< as the rig has them

  /// The light that an observation stands for.
  Rgb estimated_light(const Observation& observation, const CameraParameters& camera) const;
  /// How far an observation is from what its camera should show, standard deviations, the worst
  /// channel's.
  double normalised_residual(const Observation& observation) const;

  /// By the points of which `counts(point)`, and the observations that count. `scale`: in standard
  /// deviations, beyond which an observation is told to be odd. Throws Error (failed) when a stop
  /// is asked for.
  void solve(double scale, const std::function<bool(std::size_t)>& counts,
             const std::stop_token& stop);

  /// Two standard deviations of the light that each camera is said to see, by it, the worst of its
  /// channels and of a tenth and half of full scale: by the covariance of the solution, as noisy as
  /// its residuals, points left as free as their observations leave them; the assumption about
  /// small brightness tells nothing here. 0 for the reference camera, a large number for what
  /// nothing tells. `scale`: as it was solved.
  std::vector<double> uncertainty(double scale) const;

 private:
  std::vector<Rgb> mean_lights() const;

  const Rig& rig_;
  std::size_t reference_;
  std::vector<Observation> observations_;
  std::vector<ColorMatrix> unmix_;
  std::vector<CameraParameters> cameras_, start_;
  std::vector<Rgb> light_;  ///< of each point
};

}  // namespace raystage
