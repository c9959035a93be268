// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "store/processing/sync/clock_fit.h"

namespace raystage {

/// What fit_clocks() stands on: lines through counted frames. All work on `fit.slots` and
/// `fit.breaks` as they are and write lattice, breaks' steps and residuals.

/// Stamps and fit of one camera.
struct CameraLine {
  std::span<const double> times;
  ClockFit* fit = nullptr;
};

/// Steps that the group's cameras share: the highest number plus one.
int group_steps_of(std::span<const CameraLine> group);

/// Weighted least squares over the cameras of a group: a line each, one step for each break of the
/// camera's own, one for each step of the group in common (Schur complement). Huber's weights from
/// each camera's jitter; none for outliers.
void fit_least_squares(std::span<const CameraLine> group);

/// The line under all frames (lower_envelope), one step for each break as above. Starts from a
/// least squares fit; frames before lower_edge() are left out.
void fit_envelope(std::span<const CameraLine> group);

/// How unlikely a frame is by how far it lies from its slot, ns, and the share of a period that
/// counts for the slot behind it.
struct Likeness {
  double early_scale = 0, late_scale = 0, early_share = 0.5;
};
/// Breaks are found by the phase of single frames. With the line known, each moves by up to two
/// frames to where its neighbours look least odd. Uses no slots and leaves them as they are.
void settle_breaks(const CameraLine& camera, const Likeness& likeness);

/// Residuals, jitter and limits of outliers from lattice and breaks.
void update_residuals(const CameraLine& camera);

/// Residuals below this are not of the edge: as early_limit, but above up to three frames that lie
/// far apart from the twenty next to them.
double lower_edge(const ClockFit& fit);

/// The line under (slot, time) pairs, slots increasing, with the least sum of residuals: an edge of
/// their lower hull. `posterior_mean`: instead the mean of all lines below, each weighted by its
/// likelihood where delays are exponential. No estimator that moves with the data has a smaller
/// mean squared error then (Pitman). Both need two points.
struct Envelope {
  Lattice line;
  double sum = 0;  ///< of the residuals of the edge
};
Envelope lower_envelope(std::span<const double> slots, std::span<const double> times,
                        bool posterior_mean);
Lattice least_squares_line(std::span<const double> slots, std::span<const double> times);

}  // namespace raystage
