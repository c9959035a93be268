// SPDX-License-Identifier: Apache-2.0
// Estimates a response curve at fixed knots (piecewise linear in the code) together with the light
// of each location and, with samples of exposure 0, a dark level. Method: non-linear robust least
// squares (Ceres, Cauchy's loss) with a smoothness term, after Debevec and Malik (SIGGRAPH 1997).
// Output: curve values at the knots, increasing, 0 at black and 1 at full scale. Cost: samples
// times knots squared.
#include "calibrate/color/response_curve.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "base/error.h"
#include "base/parallel.h"
#include "base/transfer_function.h"
#include "calibrate/geometry/ceres_options.h"

namespace raystage::calibrate {
namespace {

constexpr int kKnots = 33;
constexpr double kStep = 1.0 / (kKnots - 1);

template <typename T>
T light_of_straight(const T& code, bool is_linear) {
  using std::pow;
  if (is_linear) return code;
  if (code <= T(0.04045)) return code / 12.92;
  return pow((code + 0.055) / 1.055, 2.4);
}

/// Residual: light of the linearised code minus light proportional to exposure, in standard
/// deviations.
struct ExposureError {
  ResponseSample shown;
  bool is_linear;
  double deviation;

  template <typename T>
  bool operator()(const T* curve, const T* light, const T* black, T* error) const {
    const int knot = std::clamp(static_cast<int>(shown.code / kStep), 0, kKnots - 2);
    const double share = shown.code / kStep - knot;
    const T straight = curve[knot] * (1 - share) + curve[knot + 1] * share;
    error[0] =
        (light_of_straight(straight, is_linear) - black[0] - light[0] * shown.exposure) / deviation;
    return true;
  }
};

/// Smoothness term: second differences are small; they may be larger near black.
struct Bend {
  int knot;
  template <typename T>
  bool operator()(const T* curve, T* error) const {
    constexpr double kUsual = 5e-4, kNearBlack = 0.1;
    error[0] = (curve[knot - 1] - 2.0 * curve[knot] + curve[knot + 1]) /
               (kUsual * (1 + kNearBlack / (knot * kStep)));
    return true;
  }
};

/// Fixes black and full scale: exposures determine neither, and contrast and brightness account for
/// both.
struct Anchor {
  template <typename T>
  bool operator()(const T* curve, T* error) const {
    error[0] = curve[0] * 1e4;
    error[1] = (curve[kKnots - 1] - 1.0) * 1e4;
    return true;
  }
};

double code_of_light(double light, bool is_linear) {
  return is_linear ? light : srgb_from_linear(light);
}

/// Samples of one channel at some locations of the picture.
void add_places(const FlatFieldMeasurement& measurement, double exposure, std::size_t channel,
                bool is_linear, std::vector<ResponseSample>& codes) {
  constexpr std::size_t kPlaces = 60;
  constexpr double kClipped = 0.96, kBlack = 2.0 / 255;
  for (std::size_t location = 0; location < kPlaces; ++location) {
    const FlatFieldCell& cell = measurement.cells[location * measurement.cells.size() / kPlaces];
    const double code = code_of_light(cell.mean[channel], is_linear);
    if (code < kBlack || std::ranges::max(cell.mean) > kClipped) continue;
    codes.push_back({static_cast<int>(location), exposure, code});
  }
}

}  // namespace

std::vector<double> fit_response_curve(std::span<const ResponseSample> codes,
                                       const std::string& color_space) {
  const bool is_linear = color_space == "lin_rec709_scene";
  std::set<double> exposures;
  int places = 0;
  bool has_dark = false;
  for (const ResponseSample& shown : codes) {
    if (shown.exposure > 0) exposures.insert(shown.exposure);
    has_dark = has_dark || shown.exposure == 0;
    places = std::max(places, shown.location + 1);
  }
  if (exposures.size() < 2) {
    throw Error::bad_input("fewer than two exposures have usable codes", "exposures",
                           "Record at least two different exposures in which the target is neither "
                           "black nor at full scale")
        .concerning({"exposures"});
  }
  std::vector<double> curve;
  for (int knot = 0; knot < kKnots; ++knot) curve.push_back(knot * kStep);
  double black = 0;
  // Initial values: the identity curve.
  std::vector<double> light(static_cast<std::size_t>(places), 0), weight(light);
  for (const ResponseSample& shown : codes) {
    light[shown.location] += light_of_straight(shown.code, is_linear);
    weight[shown.location] += shown.exposure;
  }
  for (std::size_t location = 0; location < light.size(); ++location) {
    light[location] /= std::max(weight[location], 1e-12);
  }
  ceres::Problem problem;
  for (const ResponseSample& shown : codes) {
    constexpr double kNoiseFloor = 0.0005, kRelativeNoise = 0.003, kCauchyScale = 3;
    const double deviation =
        kNoiseFloor + kRelativeNoise * light_of_straight(shown.code, is_linear);
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<ExposureError, 1, kKnots, 1, 1>(
                                 new ExposureError{shown, is_linear, deviation}),
                             new ceres::CauchyLoss(kCauchyScale), curve.data(),
                             &light[shown.location], &black);
  }
  for (int knot = 1; knot + 1 < kKnots; ++knot) {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Bend, 1, kKnots>(new Bend{knot}),
                             nullptr, curve.data());
  }
  problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Anchor, 2, kKnots>(new Anchor), nullptr,
                           curve.data());
  if (!has_dark) problem.SetParameterBlockConstant(&black);
  ceres::Solver::Summary summary;
  ceres::Solve(ceres_options(ceres::DENSE_QR, 200, 1e-10), &problem, &summary);
  // Makes the curve increasing where noise or missing samples made it fall.
  constexpr double kMinRise = 1e-4;
  for (std::size_t knot = curve.size() - 1; knot > 0; --knot) {
    curve[knot - 1] = std::min(curve[knot - 1], curve[knot] - kMinRise);
  }
  return curve;
}

std::vector<schemas::PhotometricResponse> fit_response_curves(
    const std::vector<FlatFieldMeasurements>& measurements, std::span<const double> exposures,
    const FlatFieldMeasurements* dark, const std::string& color_space) {
  const bool is_linear = color_space == "lin_rec709_scene";
  std::vector<schemas::PhotometricResponse> responses(measurements.front().size());
  parallel_for(std::size_t{0}, responses.size(), [&](std::size_t camera) {
    for (std::size_t channel = 0; channel < 3; ++channel) {
      std::vector<ResponseSample> codes;
      for (std::size_t i = 0; i < exposures.size(); ++i) {
        add_places(measurements[i][camera], exposures[i], channel, is_linear, codes);
      }
      if (dark != nullptr) add_places((*dark)[camera], 0, channel, is_linear, codes);
      responses[camera].curve[channel] = fit_response_curve(codes, color_space);
    }
  });
  return responses;
}

}  // namespace raystage::calibrate
