// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "schemas/geometry.h"

namespace raystage::calibrate {

/// Lens parameters of the solvers: fx, fy, cx, cy, and up to five distortion terms of the lens
/// model (lens_parameterization()).
constexpr int kLensParameterCount = 9;
using LensParameters = std::array<double, kLensParameterCount>;

/// Lens parameters that a bundle adjustment refines; each step includes those of the one before.
enum class LensRefinement {
  kNone,
  kFocalLength,  ///< one for x and y (square pixels)
  kPinhole,      ///< and the principal point
  kRadial,       ///< and the first two terms of the radial distortion
  kFullModel     ///< and all other terms, separate focal lengths for x and y
};

/// A lens parameter of a model.
struct LensParameter {
  std::string_view name;  ///< "k1"; empty: the model has no such parameter
  /// first step that refines it
  LensRefinement refined_from = LensRefinement::kFullModel;
  int radial_power = 0;  ///< of a radial distortion term: the power of the distance; otherwise 0
  /// Deviation of the weak prior on a distortion term, for terms that observations leave open.
  double ordinary_deviation = 1;
  /// Standard deviation among the lenses of one type: of focal lengths relative, of distortion
  /// terms absolute; 0: they are independent.
  double deviation_in_type = 0;
};

/// The meaning of the lens parameters in a lens model. To add one: implement this, and return it in
/// lens_parameterization().
class LensParameterization {
 public:
  virtual ~LensParameterization() = default;
  virtual const std::array<LensParameter, kLensParameterCount>& parameters() const = 0;
  virtual LensParameters values(const schemas::Intrinsics& lens) const = 0;
  /// Replaces the parameters of a lens; projection and half angle remain.
  virtual void set_values(const LensParameters& values, schemas::Intrinsics& lens) const = 0;
};

/// Returns the parameterization of a projection: Brown-Conrady for pinholes (k1, k2, p1, p2, k3),
/// factors of r^3, r^5, r^7 and r^9 for the others (k1 to k4). It lives until the program ends.
const LensParameterization& lens_parameterization(schemas::Projection projection);

/// Returns the parameters of a lens.
LensParameters lens_parameters(const schemas::Intrinsics& lens);

/// Returns the lens with these parameters, and the projection and half angle of `lens`.
schemas::Intrinsics lens_with_parameters(const LensParameters& values, schemas::Intrinsics lens);

/// Returns the indices of the lens parameters that a bundle adjustment holds, in ascending order.
/// Except for the full model fy follows fx.
std::vector<int> fixed_lens_parameters(LensRefinement freedom, schemas::Projection projection);

}  // namespace raystage::calibrate
