// SPDX-License-Identifier: Apache-2.0
// The lens parameters of pinholes and of fisheyes: names, conversion from and to intrinsics, and
// the order in which solvers release them.
#include "calibrate/geometry/lens_parameters.h"

namespace raystage::calibrate {
namespace {

using Step = LensRefinement;

constexpr LensParameter kFx{"fx", Step::kFocalLength, 0, 0, 0.004};
constexpr LensParameter kFy{"fy", Step::kFullModel, 0, 0, 0.004};
constexpr LensParameter kCx{"cx", Step::kPinhole, 0, 0, 0};
constexpr LensParameter kCy{"cy", Step::kPinhole, 0, 0, 0};

class PinholeParameters final : public LensParameterization {
 public:
  const std::array<LensParameter, kLensParameterCount>& parameters() const override {
    static constexpr std::array<LensParameter, kLensParameterCount> kParameters{
        kFx,
        kFy,
        kCx,
        kCy,
        LensParameter{"k1", Step::kRadial, 3, 1, 0.01},
        LensParameter{"k2", Step::kRadial, 5, 1, 0.02},
        LensParameter{"p1", Step::kFullModel, 0, 0.1, 0.001},
        LensParameter{"p2", Step::kFullModel, 0, 0.1, 0.001},
        LensParameter{"k3", Step::kFullModel, 7, 2, 0.04}};
    return kParameters;
  }
  LensParameters values(const schemas::Intrinsics& k) const override {
    const schemas::Distortion& d = k.distortion;
    return {k.fx, k.fy, k.cx, k.cy, d.k1, d.k2, d.p1, d.p2, d.k3};
  }
  void set_values(const LensParameters& v, schemas::Intrinsics& lens) const override {
    lens.fx = v[0];
    lens.fy = v[1];
    lens.cx = v[2];
    lens.cy = v[3];
    lens.distortion = {v[4], v[5], v[6], v[7], v[8]};
  }
};

class FisheyeParameters final : public LensParameterization {
 public:
  const std::array<LensParameter, kLensParameterCount>& parameters() const override {
    // Distances reach 2 to 3 focal lengths, so that high powers are large: their factors are small.
    static constexpr std::array<LensParameter, kLensParameterCount> kParameters{
        kFx,
        kFy,
        kCx,
        kCy,
        LensParameter{"k1", Step::kRadial, 3, 1, 0.004},
        LensParameter{"k2", Step::kRadial, 5, 1, 0.002},
        LensParameter{"k3", Step::kFullModel, 7, 1, 0.001},
        LensParameter{"k4", Step::kFullModel, 9, 1, 0.0005},
        LensParameter{}};
    return kParameters;
  }
  LensParameters values(const schemas::Intrinsics& k) const override {
    const std::array<double, 4>& r = k.radial_distortion;
    return {k.fx, k.fy, k.cx, k.cy, r[0], r[1], r[2], r[3], 0};
  }
  void set_values(const LensParameters& v, schemas::Intrinsics& lens) const override {
    lens.fx = v[0];
    lens.fy = v[1];
    lens.cx = v[2];
    lens.cy = v[3];
    lens.radial_distortion = {v[4], v[5], v[6], v[7]};
  }
};

}  // namespace

const LensParameterization& lens_parameterization(schemas::Projection projection) {
  static const PinholeParameters pinhole;
  static const FisheyeParameters fisheye;
  if (projection == schemas::Projection::kPinhole) return pinhole;
  return fisheye;
}

LensParameters lens_parameters(const schemas::Intrinsics& lens) {
  return lens_parameterization(lens.projection).values(lens);
}

schemas::Intrinsics lens_with_parameters(const LensParameters& values, schemas::Intrinsics lens) {
  lens_parameterization(lens.projection).set_values(values, lens);
  return lens;
}

std::vector<int> fixed_lens_parameters(LensRefinement freedom, schemas::Projection projection) {
  std::vector<int> held;
  const auto& parameters = lens_parameterization(projection).parameters();
  for (int i = 0; i < kLensParameterCount; ++i) {
    const LensParameter& parameter = parameters[static_cast<std::size_t>(i)];
    if (parameter.name.empty() || freedom < parameter.refined_from) held.push_back(i);
  }
  return held;
}

}  // namespace raystage::calibrate
