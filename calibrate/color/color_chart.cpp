// SPDX-License-Identifier: Apache-2.0
// Fits a 3x3 colour matrix per camera (thesis 4.3: colour target) so that its patches match those
// of the reference camera or the published values. Robust least squares (Ceres, Cauchy's loss) over
// 24 patches and 3 channels; the brightness is a parameter if it is not known. Input: linear RGB
// means, full scale 1. Cost: cameras times patches.
#include "calibrate/color/color_chart.h"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calibrate/color/color_difference.h"
#include "calibrate/geometry/calibration_verdict.h"
#include "calibrate/geometry/ceres_options.h"

namespace raystage::calibrate {
namespace {

/// Residual: light of a patch minus its expected light, in standard deviations.
struct PatchError {
  schemas::Rgb measured, gain, contrast, expected;

  template <typename T>
  bool operator()(const T* matrix, const T* brightness, T* error) const {
    T light[3];
    for (std::size_t c = 0; c < 3; ++c) {
      light[c] = gain[c] * (brightness[c] + contrast[c] * measured[c]);
    }
    constexpr double kNoiseFloor = 0.004, kRelativeNoise = 0.02;
    for (std::size_t row = 0; row < 3; ++row) {
      const T made = matrix[3 * row] * light[0] + matrix[3 * row + 1] * light[1] +
                     matrix[3 * row + 2] * light[2];
      error[row] =
          (made - expected[row]) / (kNoiseFloor + kRelativeNoise * std::abs(expected[row]));
    }
    return true;
  }
};

/// Returns the light of a patch according to a camera's response.
schemas::Rgb light_of(const ChartMeasurement& measurement, std::size_t patch,
                      const schemas::PhotometricResponse& response) {
  const ChartMeasurement::Patch& p = measurement.patches[patch];
  return rig::apply_photometric_correction(response, measurement.size, static_cast<int>(p.x),
                                           static_cast<int>(p.y), p.measured);
}

bool counts(const ChartMeasurement& measurement, std::size_t patch) {
  return measurement.patches[patch].is_exposed;
}

/// Scales the expected colours to the brightness of the greys in the camera: the slope of a line,
/// because the black level may be unknown.
rig::PatchColors published_by(const ChartMeasurement& reference,
                              const schemas::PhotometricResponse& response) {
  rig::PatchColors light = rig::color_checker_reference();
  double count = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (std::size_t p = rig::kFirstNeutralPatch; p < light.size(); ++p) {
    if (!counts(reference, p)) continue;
    const double known = light[p][1], measured = light_of(reference, p, response)[1];
    count += 1;
    x += known;
    y += measured;
    xx += known * known;
    xy += known * measured;
  }
  const double spread = count * xx - x * x;
  const double scale = spread > 0 ? (count * xy - x * y) / spread : 0;
  for (schemas::Rgb& patch : light) {
    for (double& channel : patch) channel *= scale;
  }
  return light;
}

/// Fits the matrix, and the brightness if it is not known.
void fit(const ChartMeasurement& measurement, const std::vector<bool>& used,
         const rig::PatchColors& expected, bool finds_brightness,
         schemas::PhotometricResponse& response) {
  std::array<double, 9> matrix{1, 0, 0, 0, 1, 0, 0, 0, 1};
  ceres::Problem problem;
  for (std::size_t p = 0; p < expected.size(); ++p) {
    if (!used[p]) continue;
    const ChartMeasurement::Patch& patch = measurement.patches[p];
    constexpr double kCauchyScale = 2;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<PatchError, 3, 9, 3>(new PatchError{
            patch.measured, rig::gain_at(response, measurement.size, patch.x, patch.y),
            response.contrast, expected[p]}),
        new ceres::CauchyLoss(kCauchyScale), matrix.data(), response.brightness.data());
  }
  if (!finds_brightness) problem.SetParameterBlockConstant(response.brightness.data());
  ceres::Solver::Summary summary;
  ceres::Solve(ceres_options(ceres::DENSE_QR, 200), &problem, &summary);
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t c = 0; c < 3; ++c) response.matrix[row][c] = matrix[3 * row + c];
  }
}

/// Returns the residuals of one camera's patches.
ColorFit fit_of(const ChartMeasurement& measurement, const schemas::PhotometricResponse& response,
                const std::vector<bool>& used, const rig::PatchColors& expected) {
  ColorFit fit;
  if (measurement.frames == 0) return fit;
  fit.observations = rig::kChartPatches;
  for (std::size_t p = 0; p < expected.size(); ++p) {
    if (!used[p]) continue;
    const double off = color_difference(lab_from_linear(expected[p]),
                                        lab_from_linear(light_of(measurement, p, response)));
    fit.mean_difference += off;
    fit.max_difference = std::max(fit.max_difference, off);
    ++fit.inliers;
  }
  fit.mean_difference /= std::max(1, fit.inliers);
  return fit;
}

std::vector<ColorFit> fits_of(const std::vector<ChartMeasurement>& measurements,
                              const std::vector<schemas::PhotometricResponse>& responses,
                              const std::vector<std::vector<bool>>& used,
                              const rig::PatchColors& expected) {
  std::vector<ColorFit> fits;
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    fits.push_back(fit_of(measurements[i], responses[i], used[i], expected));
  }
  return fits;
}

ColorSpread spread_of(const std::vector<ChartMeasurement>& measurements,
                      const std::vector<schemas::PhotometricResponse>& responses,
                      const std::vector<std::vector<bool>>& used,
                      const rig::PatchColors& expected) {
  ColorSpread spread;
  std::vector<schemas::Rgb> ratios;
  const std::vector<ColorFit> fits = fits_of(measurements, responses, used, expected);
  int count = 0;
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    spread.mean_difference += fits[i].inliers * fits[i].mean_difference;
    spread.max_difference = std::max(spread.max_difference, fits[i].max_difference);
    count += fits[i].inliers;
    if (fits[i].inliers == 0) continue;
    schemas::Rgb measured{}, known{};
    for (std::size_t p = 0; p < expected.size(); ++p) {
      if (!used[i][p]) continue;
      const schemas::Rgb light = light_of(measurements[i], p, responses[i]);
      for (std::size_t c = 0; c < 3; ++c) {
        measured[c] += light[c];
        known[c] += expected[p][c];
      }
    }
    ratios.push_back({measured[0] / known[0], measured[1] / known[1], measured[2] / known[2]});
  }
  spread.mean_difference /= std::max(1, count);
  for (std::size_t c = 0; c < 3; ++c) spread.deviation[c] = relative_deviation(ratios, c);
  return spread;
}

}  // namespace

ColorMatch match_charts(const std::vector<ChartMeasurement>& measurements,
                        const std::vector<schemas::PhotometricResponse>& responses,
                        const std::vector<std::string>& cameras, const ChartMatchOptions& options) {
  const auto reference = static_cast<std::size_t>(options.reference);
  ColorMatch match;
  match.what = "chart";
  match.responses = responses;
  for (schemas::PhotometricResponse& response : match.responses)
    response.matrix = schemas::kIdentityColorMatrix;
  std::vector<std::string> blind;
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    if (measurements[i].frames == 0) blind.push_back(cameras[i]);
  }
  add_sentence(match.reasons, "The chart was not found by ", blind,
               ": show the whole chart, upright and sharp, in at least a fifth of the picture.");
  if (measurements[reference].frames == 0) {
    match.responses = responses;
    match.fits.resize(measurements.size());
    return match;
  }
  rig::PatchColors expected{};
  if (options.use_published_values) {
    expected = published_by(measurements[reference], match.responses[reference]);
  } else {
    for (std::size_t p = 0; p < expected.size(); ++p) {
      expected[p] = light_of(measurements[reference], p, match.responses[reference]);
    }
  }
  std::vector<std::vector<bool>> used(measurements.size());
  constexpr std::ptrdiff_t kMinUsed = 18;  // patches
  std::vector<bool> is_usable;
  std::vector<std::string> overexposed;
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    for (std::size_t p = 0; p < expected.size(); ++p) {
      used[i].push_back(counts(measurements[i], p) &&
                        (options.use_published_values || counts(measurements[reference], p)));
    }
    const bool is_exposed = std::ranges::count(used[i], true) >= kMinUsed;
    is_usable.push_back(measurements[i].frames > 0 && is_exposed);
    if (measurements[i].frames > 0 && !is_exposed) overexposed.push_back(cameras[i]);
  }
  add_sentence(match.reasons, "The chart is overexposed or too dark in ", overexposed,
               ": expose so that white is below full scale and black above 0.");
  match.before = spread_of(measurements, responses, used, expected);
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    schemas::PhotometricResponse& response = match.responses[i];
    if (!is_usable[i]) {
      response = responses[i];
      continue;
    }
    if (i == reference && !options.use_published_values) continue;
    const bool finds_brightness =
        response.contrast == schemas::Rgb{1, 1, 1} && response.brightness == schemas::Rgb{0, 0, 0};
    fit(measurements[i], used[i], expected, finds_brightness, response);
  }
  match.after = spread_of(measurements, match.responses, used, expected);
  match.fits = fits_of(measurements, match.responses, used, expected);
  // CIEDE2000; sensors whose sensitivities differ from the eye's reach 2
  constexpr double kMaxDeviation = 4;
  std::vector<std::string> wrong;
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    if (is_usable[i] && !(match.fits[i].mean_difference <= kMaxDeviation))
      wrong.push_back(cameras[i]);
  }
  add_sentence(match.reasons, "The corrected colours differ from the chart in ", wrong,
               ": use a ColorChecker Classic, light it evenly, and calibrate the response curves.");
  const auto worst = std::ranges::max_element(match.fits, {}, &ColorFit::mean_difference);
  match.findings.push_back(
      fmt::format("Worst      {}: CIEDE2000 mean {:.2f} over {} patches, maximum {:.2f}",
                  cameras[worst - match.fits.begin()], worst->mean_difference, worst->inliers,
                  worst->max_difference));
  return match;
}

}  // namespace raystage::calibrate
