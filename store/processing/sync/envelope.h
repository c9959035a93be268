// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "store/processing/sync/line_fit.h"

namespace raystage::store {

/// Fits the line under all frames (lower_envelope()) and the steps as above. Starts from a least
/// squares fit; ignores frames below lower_edge().
void fit_envelope(std::span<const CameraLine> group);

/// Returns the smallest residual that belongs to the envelope, ns: early_limit, or a larger value
/// that excludes up to three frames far below the next twenty.
double lower_edge(const ClockFit& fit);

/// A line under (slot, time) pairs.
struct Envelope {
  Lattice line;
  double sum = 0;  ///< of the residuals from the hull's edge, ns
};
/// Returns the line below all pairs with the least sum of residuals, an edge of their lower hull.
/// `posterior_mean`: returns the mean of all lines below, weighted by likelihood for exponential
/// delays. It has the least mean squared error of all equivariant estimators (Pitman). Slots must
/// increase; needs two points.
Envelope lower_envelope(std::span<const double> slots, std::span<const double> times,
                        bool posterior_mean);

}  // namespace raystage::store
