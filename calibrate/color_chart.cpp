// SPDX-License-Identifier: Apache-2.0
#include "calibrate/color_chart.h"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calibrate/color_difference.h"
#include "rig/calibration/verdict.h"
#include "schemas/error.h"

namespace raystage {
namespace {

/// Light of a patch beside what it should be, in standard deviations.
struct PatchError {
  Rgb shown, gain, contrast, expected;

  template <typename T>
  bool operator()(const T* matrix, const T* brightness, T* error) const {
    T light[3];
    for (std::size_t c = 0; c < 3; ++c) {
      light[c] = gain[c] * (brightness[c] + contrast[c] * shown[c]);
    }
    constexpr double kInTheDark = 0.004, kByLight = 0.02;
    for (std::size_t row = 0; row < 3; ++row) {
      const T made = matrix[3 * row] * light[0] + matrix[3 * row + 1] * light[1] +
                     matrix[3 * row + 2] * light[2];
      error[row] = (made - expected[row]) / (kInTheDark + kByLight * std::abs(expected[row]));
    }
    return true;
  }
};

/// The light of a patch by a camera's response.
Rgb light_of(const ChartSight& sight, std::size_t patch, const PhotometricResponse& response) {
  const ChartSight::Patch& p = sight.patches[patch];
  return light_of_shown(response, sight.size, static_cast<int>(p.x), static_cast<int>(p.y),
                        p.shown);
}

bool counts(const ChartSight& sight, std::size_t patch) { return sight.patches[patch].is_exposed; }

/// As bright as the camera shows the greys: the slope of a line, as its black may not be known.
ChartLight published_by(const ChartSight& reference, const PhotometricResponse& response) {
  ChartLight light = color_checker_light();
  double count = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (std::size_t p = kFirstGrey; p < light.size(); ++p) {
    if (!counts(reference, p)) continue;
    const double known = light[p][1], shown = light_of(reference, p, response)[1];
    count += 1;
    x += known;
    y += shown;
    xx += known * known;
    xy += known * shown;
  }
  const double spread = count * xx - x * x;
  const double scale = spread > 0 ? (count * xy - x * y) / spread : 0;
  for (Rgb& patch : light) {
    for (double& channel : patch) channel *= scale;
  }
  return light;
}

/// Matrix, and brightness where it is not known.
void fit(const ChartSight& sight, const std::vector<bool>& used, const ChartLight& expected,
         bool finds_brightness, PhotometricResponse& response) {
  std::array<double, 9> matrix{1, 0, 0, 0, 1, 0, 0, 0, 1};
  ceres::Problem problem;
  for (std::size_t p = 0; p < expected.size(); ++p) {
    if (!used[p]) continue;
    const ChartSight::Patch& patch = sight.patches[p];
    constexpr double kOdd = 2;
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PatchError, 3, 9, 3>(new PatchError{
                                 patch.shown, gain_at(response, sight.size, patch.x, patch.y),
                                 response.contrast, expected[p]}),
                             new ceres::CauchyLoss(kOdd), matrix.data(),
                             response.brightness.data());
  }
  if (!finds_brightness) problem.SetParameterBlockConstant(response.brightness.data());
  ceres::Solver::Options options;
  options.num_threads = 1;  // the same result everywhere
  options.logging_type = ceres::SILENT;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 200;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t c = 0; c < 3; ++c) response.matrix[row][c] = matrix[3 * row + c];
  }
}

/// How far one camera's patches are from what they should be.
ColorFit fit_of(const ChartSight& sight, const PhotometricResponse& response,
                const std::vector<bool>& used, const ChartLight& expected) {
  ColorFit fit;
  if (sight.frames == 0) return fit;
  fit.seen = kChartPatches;
  for (std::size_t p = 0; p < expected.size(); ++p) {
    if (!used[p]) continue;
    const double off = color_difference(lab_from_linear(expected[p]),
                                        lab_from_linear(light_of(sight, p, response)));
    fit.mean_difference += off;
    fit.most_difference = std::max(fit.most_difference, off);
    ++fit.kept;
  }
  fit.mean_difference /= std::max(1, fit.kept);
  return fit;
}

std::vector<ColorFit> fits_of(const std::vector<ChartSight>& sights,
                              const std::vector<PhotometricResponse>& responses,
                              const std::vector<std::vector<bool>>& used,
                              const ChartLight& expected) {
  std::vector<ColorFit> fits;
  for (std::size_t i = 0; i < sights.size(); ++i) {
    fits.push_back(fit_of(sights[i], responses[i], used[i], expected));
  }
  return fits;
}

ColorSpread spread_of(const std::vector<ChartSight>& sights,
                      const std::vector<PhotometricResponse>& responses,
                      const std::vector<std::vector<bool>>& used, const ChartLight& expected) {
  ColorSpread spread;
  std::vector<Rgb> ratios;
  const std::vector<ColorFit> fits = fits_of(sights, responses, used, expected);
  int count = 0;
  for (std::size_t i = 0; i < sights.size(); ++i) {
    spread.mean_difference += fits[i].kept * fits[i].mean_difference;
    spread.most_difference = std::max(spread.most_difference, fits[i].most_difference);
    count += fits[i].kept;
    if (fits[i].kept == 0) continue;
    Rgb shown{}, known{};
    for (std::size_t p = 0; p < expected.size(); ++p) {
      if (!used[i][p]) continue;
      const Rgb light = light_of(sights[i], p, responses[i]);
      for (std::size_t c = 0; c < 3; ++c) {
        shown[c] += light[c];
        known[c] += expected[p][c];
      }
    }
    ratios.push_back({shown[0] / known[0], shown[1] / known[1], shown[2] / known[2]});
  }
  spread.mean_difference /= std::max(1, count);
  for (std::size_t c = 0; c < 3; ++c) spread.deviation[c] = relative_deviation(ratios, c);
  return spread;
}

}  // namespace

ColorMatch match_charts(const std::vector<ChartSight>& sights,
                        const std::vector<PhotometricResponse>& responses,
                        const std::vector<std::string>& cameras,
                        const ChartColorSettings& settings) {
  const auto reference = static_cast<std::size_t>(settings.reference);
  ColorMatch match;
  match.what = "chart";
  match.responses = responses;
  for (PhotometricResponse& response : match.responses) response.matrix = kSameColors;
  std::vector<std::string> blind;
  for (std::size_t i = 0; i < sights.size(); ++i) {
    if (sights[i].frames == 0) blind.push_back(cameras[i]);
  }
  if (!blind.empty()) {
    match.reasons.push_back(
        "The chart was not found by " + few_of(blind) +
        ": let every camera see all of it, upright, sharp, a fifth of the picture large or more.");
  }
  if (sights[reference].frames == 0) {
    match.responses = responses;
    match.fits.resize(sights.size());
    return match;
  }
  ChartLight expected{};
  if (settings.published) {
    expected = published_by(sights[reference], match.responses[reference]);
  } else {
    for (std::size_t p = 0; p < expected.size(); ++p) {
      expected[p] = light_of(sights[reference], p, match.responses[reference]);
    }
  }
  std::vector<std::vector<bool>> used(sights.size());
  constexpr std::ptrdiff_t kLeastUsed = 18;  // patches
  std::vector<bool> is_usable;
  std::vector<std::string> overexposed;
  for (std::size_t i = 0; i < sights.size(); ++i) {
    for (std::size_t p = 0; p < expected.size(); ++p) {
      used[i].push_back(counts(sights[i], p) &&
                        (settings.published || counts(sights[reference], p)));
    }
    const bool is_exposed = std::ranges::count(used[i], true) >= kLeastUsed;
    is_usable.push_back(sights[i].frames > 0 && is_exposed);
    if (sights[i].frames > 0 && !is_exposed) overexposed.push_back(cameras[i]);
  }
  if (!overexposed.empty()) {
    match.reasons.push_back("The chart is overexposed or too dark in " + few_of(overexposed) +
                            ": expose so that white stays below full scale, and black above 0.");
  }
  match.before = spread_of(sights, responses, used, expected);
  for (std::size_t i = 0; i < sights.size(); ++i) {
    PhotometricResponse& response = match.responses[i];
    if (!is_usable[i]) {
      response = responses[i];
      continue;
    }
    if (i == reference && !settings.published) continue;
    const bool finds_brightness =
        response.contrast == Rgb{1, 1, 1} && response.brightness == Rgb{0, 0, 0};
    fit(sights[i], used[i], expected, finds_brightness, response);
  }
  match.after = spread_of(sights, match.responses, used, expected);
  match.fits = fits_of(sights, match.responses, used, expected);
  constexpr double kMostOff = 4;  // CIEDE2000; sensors that see other colours than an eye reach 2
  std::vector<std::string> wrong;
  for (std::size_t i = 0; i < sights.size(); ++i) {
    if (is_usable[i] && !(match.fits[i].mean_difference <= kMostOff)) wrong.push_back(cameras[i]);
  }
  if (!wrong.empty()) {
    match.reasons.push_back(
        "The chart's colours do not come out right even so in " + few_of(wrong) +
        ": is it a ColorChecker Classic, evenly lit, and are the cameras' curves known?");
  }
  const auto worst = std::ranges::max_element(match.fits, {}, &ColorFit::mean_difference);
  match.findings.push_back(
      fmt::format("Worst      {}: CIEDE2000 {:.2f} in the mean over {} patches, {:.2f} at most",
                  cameras[static_cast<std::size_t>(worst - match.fits.begin())],
                  worst->mean_difference, worst->kept, worst->most_difference));
  return match;
}

}  // namespace raystage
