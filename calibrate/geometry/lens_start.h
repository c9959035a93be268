// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "schemas/geometry.h"

namespace raystage::calibrate {

/// A kind of lens, whose parameters are to be found.
struct LensModel {
  schemas::Projection projection = schemas::Projection::kPinhole;
  std::optional<double> half_angle = std::nullopt;  ///< as Intrinsics::half_angle, radians
  bool operator==(const LensModel&) const = default;
};

/// Returns a lens of this horizontal field of view (radians; below pi for a pinhole), the principal
/// point in the middle and no distortion. A field wider than the projection reaches leaves a margin
/// beside the picture of the lens.
schemas::Intrinsics initial_lens(const LensModel& model, int width, int height,
                                 double horizontal_fov);

/// Returns the field of view of initial_lens() that has this focal length.
double horizontal_fov(const schemas::Intrinsics& lens, int width);

/// Returns the fields of view, radians, that are tried where none is known: up to 110 degrees for
/// pinholes, 80 to 270 if any lens is a fisheye.
std::vector<double> trial_fovs(std::span<const LensModel> models);

}  // namespace raystage::calibrate
