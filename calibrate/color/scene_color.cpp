// SPDX-License-Identifier: Apache-2.0
// Matches contrast and brightness of cameras by common scene points (thesis 4.3, eq. 4.1, without a
// target). SceneFit solves the joint least squares; outliers (beyond four robust standard
// deviations) are removed between solves with a decreasing loss scale. The uncertainty is the
// larger of the one from the covariance and the difference between solutions of half of the points.
// Cost: six solves over all observations.
#include "calibrate/color/scene_color.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calibrate/color/color_difference.h"
#include "calibrate/color/scene_fit.h"
#include "calibrate/geometry/calibration_verdict.h"
#include "calibrate/geometry/median.h"

namespace raystage::calibrate {
namespace {

using Observation = SceneFit::Observation;
using CameraParameters = SceneFit::CameraParameters;

/// Marks outliers, and points with a single remaining observation, as not used.
void exclude_outliers(SceneFit& fit) {
  constexpr double kSigmas = 4, kSigmaOfMedian = 1.4826, kMin = 1;
  std::vector<double> off;
  for (const Observation& observation : fit.observations())
    off.push_back(fit.normalised_residual(observation));
  if (off.empty()) return;

  const double most = kSigmas * std::max(kMin, kSigmaOfMedian * median(off));
  std::vector<int> left(fit.points(), 0);
  for (std::size_t i = 0; i < off.size(); ++i) {
    fit.observations()[i].counts = off[i] <= most;
    left[fit.observations()[i].point] += fit.observations()[i].counts ? 1 : 0;
  }
  for (Observation& observation : fit.observations())
    observation.counts = observation.counts && left[observation.point] > 1;
}

/// Differences of each camera from the mean of the other cameras at the same points.
struct Comparison {
  ColorSpread spread;
  std::vector<ColorFit> fits;  ///< only differences are set
};

Comparison compared(const SceneFit& fit, const std::vector<CameraParameters>& cameras) {
  Comparison result;
  result.fits.resize(cameras.size());
  std::vector<schemas::Rgb> sums(fit.points(), schemas::Rgb{}),
      measured(cameras.size(), schemas::Rgb{}), agreed(measured);
  std::vector<int> counts(fit.points(), 0), of_camera(cameras.size(), 0);
  for (const Observation& observation : fit.observations()) {
    if (!observation.counts) continue;
    const schemas::Rgb light = fit.estimated_light(observation, cameras[observation.camera]);
    for (std::size_t k = 0; k < 3; ++k) sums[observation.point][k] += light[k];
    ++counts[observation.point];
  }
  int count = 0;
  for (const Observation& observation : fit.observations()) {
    if (!observation.counts || counts[observation.point] < 2) continue;
    const schemas::Rgb light = fit.estimated_light(observation, cameras[observation.camera]);
    schemas::Rgb others{};
    for (std::size_t k = 0; k < 3; ++k) {
      others[k] = (sums[observation.point][k] - light[k]) / (counts[observation.point] - 1);
      measured[observation.camera][k] += light[k];
      agreed[observation.camera][k] += others[k];
    }
    const double off = color_difference(lab_from_linear(others), lab_from_linear(light));
    ColorFit& of = result.fits[observation.camera];
    of.mean_difference += off;
    of.max_difference = std::max(of.max_difference, off);
    ++of_camera[observation.camera];
    result.spread.mean_difference += off;
    result.spread.max_difference = std::max(result.spread.max_difference, off);
    ++count;
  }
  result.spread.mean_difference /= std::max(1, count);
  std::vector<schemas::Rgb> ratios;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    result.fits[c].mean_difference /= std::max(1, of_camera[c]);
    if (!(std::ranges::min(agreed[c]) > 0)) continue;
    ratios.push_back({measured[c][0] / agreed[c][0], measured[c][1] / agreed[c][1],
                      measured[c][2] / agreed[c][2]});
  }
  for (std::size_t k = 0; k < 3; ++k) result.spread.deviation[k] = relative_deviation(ratios, k);
  return result;
}

/// Returns the largest relative difference between two solutions in the light of a camera.
double difference_of(const CameraParameters& one, const CameraParameters& other) {
  double most = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    for (const double light : {0.1, 0.5}) {
      const double measured = (light - one[3 + c]) * one[c];
      most = std::max(most, std::abs(other[3 + c] + measured / other[c] - light) / light);
    }
  }
  return most;
}

/// Returns the cameras that are connected with the reference camera by common points.
std::vector<bool> joined_to(std::size_t reference, const SceneFit& fit) {
  std::vector<std::vector<std::size_t>> seen_by(fit.points());
  for (const Observation& observation : fit.observations()) {
    if (observation.counts) seen_by[observation.point].push_back(observation.camera);
  }
  std::vector<bool> joined(fit.cameras().size(), false);
  joined[reference] = true;
  for (bool grows = true; grows;) {
    grows = false;
    for (const auto& cameras : seen_by) {
      const bool any = std::ranges::any_of(cameras, [&](std::size_t c) { return joined[c]; });
      for (const std::size_t c : cameras) {
        grows = grows || (any && !joined[c]);
        joined[c] = joined[c] || any;
      }
    }
  }
  return joined;
}

void judge(SceneColorMatch& colors, const rig::Rig& rig, const std::vector<bool>& joined) {
  constexpr int kFew = 40;
  constexpr double kMaxOutlierShare = 0.35;
  constexpr double kDisagree = 2;  // CIEDE2000; 1 is just noticeable
  std::vector<std::string> few, apart, odd, disagree, uncertain;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const ColorFit& fit = colors.fits[c];
    const std::string& id = rig.cameras[c].id;
    if (fit.inliers < kFew) few.push_back(id);
    if (!joined[c]) apart.push_back(id);
    if (fit.inliers < (1 - kMaxOutlierShare) * fit.observations) odd.push_back(id);
    if (fit.mean_difference > kDisagree) disagree.push_back(id);
    if (fit.uncertainty > SceneColorMatch::kMaxUncertainty) uncertain.push_back(id);
  }
  constexpr const char* kCheckRange = ": check that the rig and the depth range match the take.";
  add_sentence(colors.reasons,
               fmt::format("Fewer than {} points are seen together with other cameras by ", kFew),
               few,
               ": specify the depth range of the scene, a matching rig, and a take with textured "
               "surfaces.");
  add_sentence(colors.reasons, "No common points connect the reference camera to ", apart,
               ": choose another reference camera, or record a white target.");
  add_sentence(colors.reasons,
               fmt::format("More than {:.0f} % of the observations are outliers in ",
                           100 * kMaxOutlierShare),
               odd, kCheckRange);
  add_sentence(colors.reasons,
               "The colours of common points still do not agree with the others in ", disagree,
               kCheckRange);
  add_sentence(colors.reasons,
               fmt::format("The light is uncertain by more than {:.0f} % in ",
                           100 * SceneColorMatch::kMaxUncertainty),
               uncertain,
               ": record a scene with light and dark surfaces, or record a white target.");
}

}  // namespace

SceneColorMatch match_scene_colors(std::span<const ScenePatch> points, const rig::Rig& rig,
                                   int reference, const std::stop_token& stop) {
  SceneFit fit(points, rig, static_cast<std::size_t>(reference));
  const auto all = [](std::size_t) { return true; };
  constexpr double kCoarse = 10, kFine = 2;
  for (const double scale : {kCoarse, kFine, kFine}) {
    fit.solve(scale, all, stop);
    exclude_outliers(fit);
  }
  fit.solve(kFine, all, stop);
  const Comparison before = compared(fit, fit.start()), after = compared(fit, fit.cameras());
  SceneColorMatch colors;
  colors.what = "scene";
  colors.before = before.spread;
  colors.after = after.spread;
  colors.fits = after.fits;
  const std::vector<double> uncertainty = fit.uncertainty(kFine);
  for (std::size_t c = 0; c < uncertainty.size(); ++c) colors.fits[c].uncertainty = uncertainty[c];
  // Errors of adjacent points are correlated (shading, reflections): two halves of the points show
  // their effect.
  for (const std::size_t half : {0, 1}) {
    SceneFit part = fit;
    constexpr std::size_t kTogether = 32;  // adjacent points in one block
    part.solve(
        kFine, [&](std::size_t point) { return point / kTogether % 2 == half; }, stop);
    for (std::size_t c = 0; c < uncertainty.size(); ++c) {
      colors.fits[c].uncertainty =
          std::max(colors.fits[c].uncertainty, difference_of(fit.cameras()[c], part.cameras()[c]));
    }
  }
  double inliers = 0;
  for (const Observation& observation : fit.observations()) {
    ++colors.fits[observation.camera].observations;
    colors.fits[observation.camera].inliers += observation.counts ? 1 : 0;
    inliers += observation.counts ? 1 : 0;
  }
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    schemas::PhotometricResponse& response =
        colors.responses.emplace_back(rig.cameras[c].photometric);
    for (std::size_t k = 0; k < 3; ++k) {
      response.contrast[k] = 1 / fit.cameras()[c][k];
      response.brightness[k] = fit.cameras()[c][3 + k];
    }
  }
  const double observations = std::max(1.0, static_cast<double>(fit.observations().size()));
  const auto most = std::ranges::max_element(colors.fits, {}, &ColorFit::uncertainty);
  colors.findings.push_back(fmt::format(
      "Scene      {} points, {:.1f} cameras per point; {:.1f} % of the observations are outliers",
      points.size(), observations / std::max(1.0, static_cast<double>(points.size())),
      100 * (1 - inliers / observations)));
  colors.findings.push_back(fmt::format("Uncertain  light by at most {:.2f} % (two sigma, {})",
                                        100 * most->uncertainty,
                                        rig.cameras[most - colors.fits.begin()].id));
  judge(colors, rig, joined_to(static_cast<std::size_t>(reference), fit));
  return colors;
}

}  // namespace raystage::calibrate
