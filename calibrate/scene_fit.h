// SPDX-License-Identifier: Apache-2.0
// Inside calibrate only: cameras' contrast and brightness, and the light of points, by each other.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <stop_token>
#include <vector>

#include "calibrate/surface_points.h"
#include "rig/photometric.h"

namespace raystage {

class SceneFit {
 public:
  /// One camera's unknowns: 1 / contrast of R, G, B, then brightness.
  using Unknowns = std::array<double, 6>;
  struct Sight {
    std::size_t point = 0, camera = 0;
    Rgb shown{}, gain{}, deviation{};
    bool counts = true;
  };

  /// `rig` must outlive it.
  SceneFit(std::span<const ScenePlace> points, const Rig& rig, std::size_t reference);

  std::vector<Sight>& sights() { return sights_; }
  const std::vector<Sight>& sights() const { return sights_; }
  std::size_t points() const { return light_.size(); }
  const std::vector<Unknowns>& cameras() const { return cameras_; }
  const std::vector<Unknowns>& start() const { return start_; }  ///< as the rig has them

  /// The light that a sight stands for.
  Rgb light_of(const Sight& sight, const Unknowns& camera) const;
  /// How far a sight is from what its camera should show, standard deviations, the worst channel's.
  double misfit(const Sight& sight) const;

  /// By the points of which `counts(point)`, and the sights that count. `scale`: in standard
  /// deviations, beyond which a sight is told to be odd. Throws Error (failed) when a stop is asked
  /// for.
  void solve(double scale, const std::function<bool(std::size_t)>& counts,
             const std::stop_token& stop);

  /// Two standard deviations of the light that each camera is said to see, by it, the worst of its
  /// channels and of a tenth and half of full scale: by the covariance of the solution, as noisy as
  /// its residuals, points left as free as their sights leave them; the assumption about small
  /// brightness tells nothing here. 0 for the reference camera, a large number for what nothing
  /// tells. `scale`: as it was solved.
  std::vector<double> uncertainty(double scale) const;

 private:
  std::vector<Rgb> mean_lights() const;

  const Rig& rig_;
  std::size_t reference_;
  std::vector<Sight> sights_;
  std::vector<ColorMatrix> unmix_;
  std::vector<Unknowns> cameras_, start_;
  std::vector<Rgb> light_;  ///< of each point
};

}  // namespace raystage
