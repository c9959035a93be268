// SPDX-License-Identifier: Apache-2.0
// Moves each phase step by up to two frames to the position of the highest likelihood. The
// likelihood is that of the residuals of eight neighbouring frames from their nearest slots, with
// separate scales for early and late frames. Two frames in one slot are penalised. Times in ns.
// Cost: 40 residuals per step.
#include "store/processing/sync/refine_phase_steps.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace raystage::store {

void refine_phase_steps(const CameraLine& camera, const DelayLikelihood& likelihood) {
  constexpr std::size_t kReach = 2, kAround = 4;
  constexpr double kSharedSlot = 10;  // cost of two frames in one slot
  ClockFit& fit = *camera.fit;
  double before = 0;
  for (std::size_t k = 0; k < fit.phase_steps.size(); ++k) {
    PhaseStep& b = fit.phase_steps[k];
    const std::size_t first = b.first_frame;
    const std::size_t low = std::max(k > 0 ? fit.phase_steps[k - 1].first_frame + 1 : 0,
                                     first - std::min(first, kReach));
    const std::size_t high = std::min(
        {k + 1 < fit.phase_steps.size() ? fit.phase_steps[k + 1].first_frame : camera.times.size(),
         first + kReach + 1, camera.times.size()});
    const auto cost_of = [&](std::size_t candidate) {
      double cost = 0, previous = -std::numeric_limits<double>::infinity();
      for (std::size_t i = first - std::min(first, kAround);
           i < std::min(first + kAround, camera.times.size()); ++i) {
        const double time = camera.times[i] - before - (i >= candidate ? b.step : 0);
        const double cycles = (time - fit.lattice.origin) / fit.lattice.period;
        const double slot = std::floor(cycles + likelihood.early_share);
        const double residual = (cycles - slot) * fit.lattice.period;
        cost +=
            residual < 0 ? -residual / likelihood.early_scale : residual / likelihood.late_scale;
        cost += slot <= previous ? kSharedSlot : 0;
        previous = slot;
      }
      return cost;
    };
    double best = low <= first && first < high ? cost_of(first) : 0;
    for (std::size_t candidate = low; candidate < high; ++candidate) {
      const double cost = cost_of(candidate);
      if (cost >= best) continue;
      best = cost;
      b.first_frame = candidate;
    }
    before += b.step;
  }
}

}  // namespace raystage::store
