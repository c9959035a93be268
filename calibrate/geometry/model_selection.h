// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "schemas/geometry.h"

namespace raystage::calibrate {

/// Truncated squared errors of what was held out of a calibration at a time: a board or a point.
struct HeldOutError {
  double sum = 0;  ///< pixels squared
  int count = 0;
};

/// Returns the RMS of errors, pixels.
double rms_of(std::span<const HeldOutError> errors);

/// Returns whether boards or points fit a model worse than another one, whose errors are of the
/// same boards or points: the mean logarithm of the ratio of their squared errors is more than two
/// standard errors above 0. Ratios, because a wrong model may fail only in a few boards at the
/// edge, whose errors alone would decide about a mean.
bool fit_worse(std::span<const HeldOutError> model, std::span<const HeldOutError> other);

/// Returns the model to use among those that are not worse than the one with the least error: the
/// first, which is the pinhole, or the one with the least distortion; nullopt if all are worse.
std::optional<std::size_t> simplest_model(const std::vector<bool>& is_worse,
                                          std::span<const double> distortions);

/// Returns the name of a compared model for people; the fisheye stands for f-theta lenses, too.
std::string compared_model_name(schemas::Projection projection);

/// Returns how a model compares with the others, for people and reports.
std::string_view model_rank(bool is_best, bool is_worse);

}  // namespace raystage::calibrate
