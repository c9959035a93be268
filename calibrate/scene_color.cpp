// SPDX-License-Identifier: Apache-2.0
#include "calibrate/scene_color.h"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "calibrate/color_difference.h"
#include "rig/calibration/verdict.h"
#include "rig/photometric.h"
#include "schemas/error.h"

namespace raystage {
namespace {

/// One camera's unknowns: 1 / contrast of R, G, B, then brightness.
using Unknowns = std::array<double, 6>;

struct Sight {
  std::size_t point = 0, camera = 0;
  Rgb shown{}, gain{}, deviation{};
  bool counts = true;
};

/// What a camera should show of a point's light beside what it does, in standard deviations.
struct SightError {
  Rgb shown, gain, deviation;
  ColorMatrix unmix;

  template <typename T>
  bool operator()(const T* camera, const T* light, T* error) const {
    for (std::size_t c = 0; c < 3; ++c) {
      const T unmixed = unmix[c][0] * light[0] + unmix[c][1] * light[1] + unmix[c][2] * light[2];
      error[c] = ((unmixed / gain[c] - camera[3 + c]) * camera[c] - shown[c]) / deviation[c];
    }
    return true;
  }
};

/// Scenes that are everywhere as bright leave brightness and contrast to be told apart: then the
/// brightness stays small.
struct SmallBrightness {
  template <typename T>
  bool operator()(const T* camera, T* error) const {
    constexpr double kUsual = 0.05;
    for (int c = 0; c < 3; ++c) error[c] = camera[3 + c] / kUsual;
    return true;
  }
};

class Fit {
 public:
  Fit(std::span<const SurfacePoint> points, const Rig& rig, std::size_t reference)
      : rig_(rig), reference_(reference), points_(points.size()) {
    for (std::size_t p = 0; p < points.size(); ++p) {
      for (const SurfacePoint::Sight& seen : points[p].sights) {
        const auto camera = static_cast<std::size_t>(seen.camera);
        Sight sight{p, camera, seen.shown, gain_of(camera, seen.x, seen.y), {}, true};
        // Steps of codes in the dark; surfaces that do not look alike from everywhere.
        constexpr double kInTheDark = 0.002, kByLight = 0.01;
        for (std::size_t c = 0; c < 3; ++c) {
          sight.deviation[c] = kInTheDark + kByLight * seen.shown[c];
        }
        sights_.push_back(sight);
      }
    }
    for (const Rig::Camera& camera : rig.cameras) {
      const PhotometricResponse& r = camera.photometric;
      unmix_.push_back(inverse(r.matrix));
      cameras_.push_back({1 / r.contrast[0], 1 / r.contrast[1], 1 / r.contrast[2], r.brightness[0],
                          r.brightness[1], r.brightness[2]});
    }
    start_ = cameras_;
    light_ = lights_of(cameras_);
  }

  std::vector<Sight>& sights() { return sights_; }
  const std::vector<Unknowns>& cameras() const { return cameras_; }
  const std::vector<Unknowns>& start() const { return start_; }

  /// The light that a sight stands for.
  Rgb light_of(const Sight& sight, const Unknowns& camera) const {
    Rgb light{};
    for (std::size_t c = 0; c < 3; ++c) {
      light[c] = sight.gain[c] * (camera[3 + c] + sight.shown[c] / camera[c]);
    }
    return multiplied(rig_.cameras[sight.camera].photometric.matrix, light);
  }
  /// Of each point, what the sights that count agree about.
  std::vector<Rgb> lights_of(const std::vector<Unknowns>& cameras) const {
    std::vector<Rgb> lights(points_, Rgb{});
    std::vector<int> counts(points_, 0);
    for (const Sight& sight : sights_) {
      if (!sight.counts) continue;
      const Rgb light = light_of(sight, cameras[sight.camera]);
      for (std::size_t c = 0; c < 3; ++c) lights[sight.point][c] += light[c];
      ++counts[sight.point];
    }
    for (std::size_t p = 0; p < lights.size(); ++p) {
      for (double& channel : lights[p]) channel /= std::max(1, counts[p]);
    }
    return lights;
  }
  /// How far a sight is from what its camera should show, standard deviations, the worst channel's.
  double misfit(const Sight& sight) const {
    const SightError error{sight.shown, sight.gain, sight.deviation, unmix_[sight.camera]};
    std::array<double, 3> off{};
    error(cameras_[sight.camera].data(), light_[sight.point].data(), off.data());
    return std::max({std::abs(off[0]), std::abs(off[1]), std::abs(off[2])});
  }

  /// By the points of which `counts(point)`, and the sights that count. `scale`: in standard
  /// deviations, beyond which a sight is told to be odd.
  template <typename Counts>
  void solve(double scale, const Counts& counts) {
    ceres::Problem problem;
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (const Sight& sight : sights_) {
      if (!sight.counts || !counts(sight.point)) continue;
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<SightError, 3, 6, 3>(new SightError{
                                   sight.shown, sight.gain, sight.deviation, unmix_[sight.camera]}),
                               new ceres::CauchyLoss(scale), cameras_[sight.camera].data(),
                               light_[sight.point].data());
      ordering->AddElementToGroup(light_[sight.point].data(), 0);
    }
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<SmallBrightness, 3, 6>(new SmallBrightness), nullptr,
          cameras_[c].data());
      ordering->AddElementToGroup(cameras_[c].data(), 1);
      constexpr double kLeast = 0.01, kMost = 100;  // of contrast
      for (int k = 0; k < 3; ++k) {
        problem.SetParameterLowerBound(cameras_[c].data(), k, 1 / kMost);
        problem.SetParameterUpperBound(cameras_[c].data(), k, 1 / kLeast);
      }
    }
    problem.SetParameterBlockConstant(cameras_[reference_].data());
    ceres::Solver::Options options;
    options.num_threads = 1;  // the same result everywhere
    options.logging_type = ceres::SILENT;
    options.linear_solver_type = ceres::DENSE_SCHUR;
    options.linear_solver_ordering = ordering;
    options.max_num_iterations = 60;
    options.function_tolerance = 1e-6;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
  }

 private:
  Rgb gain_of(std::size_t camera, double x, double y) const {
    const Rig::Camera& of = rig_.cameras[camera];
    return gain_at(of.photometric, {of.model.width(), of.model.height()}, x, y);
  }

  const Rig& rig_;
  std::size_t reference_, points_;
  std::vector<Sight> sights_;
  std::vector<ColorMatrix> unmix_;
  std::vector<Unknowns> cameras_, start_;
  std::vector<Rgb> light_;  // of each point
};

/// Leaves sights out that do not fit, and points that are left with one sight.
void leave_out_odd(Fit& fit, std::size_t points) {
  constexpr double kSigmas = 4, kSigmaOfMedian = 1.4826, kLeast = 1;
  std::vector<double> off;
  for (const Sight& sight : fit.sights()) off.push_back(fit.misfit(sight));
  if (off.empty()) return;
  std::vector<double> sorted = off;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  const double most = kSigmas * std::max(kLeast, kSigmaOfMedian * *middle);
  std::vector<int> left(points, 0);
  for (std::size_t i = 0; i < off.size(); ++i) {
    fit.sights()[i].counts = off[i] <= most;
    left[fit.sights()[i].point] += fit.sights()[i].counts ? 1 : 0;
  }
  for (Sight& sight : fit.sights()) sight.counts = sight.counts && left[sight.point] > 1;
}

ColorSpread spread_of(Fit& fit, const std::vector<Unknowns>& cameras) {
  ColorSpread spread;
  const std::vector<Rgb> lights = fit.lights_of(cameras);
  std::vector<Rgb> shown(cameras.size(), Rgb{}), agreed(cameras.size(), Rgb{});
  std::vector<double> differences;
  for (const Sight& sight : fit.sights()) {
    if (!sight.counts) continue;
    const Rgb light = fit.light_of(sight, cameras[sight.camera]);
    for (std::size_t k = 0; k < 3; ++k) {
      shown[sight.camera][k] += light[k];
      agreed[sight.camera][k] += lights[sight.point][k];
    }
    differences.push_back(
        color_difference(lab_from_linear(lights[sight.point]), lab_from_linear(light)));
    spread.mean_difference += differences.back();
  }
  if (differences.empty()) return spread;
  spread.mean_difference /= static_cast<double>(differences.size());
  spread.most_difference = std::ranges::max(differences);
  std::vector<Rgb> ratios;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    if (!(std::ranges::min(agreed[c]) > 0)) continue;
    ratios.push_back(
        {shown[c][0] / agreed[c][0], shown[c][1] / agreed[c][1], shown[c][2] / agreed[c][2]});
  }
  for (std::size_t k = 0; k < 3; ++k) spread.deviation[k] = relative_deviation(ratios, k);
  return spread;
}

/// The most by which two solutions differ about what a camera shows, by its light.
double difference_of(const Unknowns& one, const Unknowns& other) {
  double most = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    for (const double light : {0.1, 0.5}) {
      const double shown = (light - one[3 + c]) * one[c];
      most = std::max(most, std::abs(other[3 + c] + shown / other[c] - light) / light);
    }
  }
  return most;
}

/// Cameras that hang together with the reference camera by points that both see.
std::vector<bool> joined_to(std::size_t reference, Fit& fit, std::size_t points) {
  std::vector<std::vector<std::size_t>> seen_by(points);
  for (const Sight& sight : fit.sights()) {
    if (sight.counts) seen_by[sight.point].push_back(sight.camera);
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

void judge(SceneColors& colors, const Rig& rig, const std::vector<bool>& joined,
           const std::vector<double>& uncertainty) {
  constexpr int kFew = 40;
  constexpr double kOdd = 0.35;
  std::vector<std::string> few, apart, odd, uncertain;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const SceneColorFit& fit = colors.fits[c];
    const std::string& id = rig.cameras[c].id;
    if (fit.kept < kFew) few.push_back(id);
    if (!joined[c]) apart.push_back(id);
    if (fit.kept < (1 - kOdd) * fit.seen) odd.push_back(id);
    if (uncertainty[c] > SceneColors::kMostUncertain) uncertain.push_back(id);
  }
  if (!few.empty()) {
    colors.reasons.push_back(fmt::format(
        "Fewer than {} places are seen together with other cameras by {}: give the depths between "
        "which the scene lies, a rig that fits, and a take with patterned surfaces.",
        kFew, few_of(few)));
  }
  if (!apart.empty()) {
    colors.reasons.push_back("Nothing joins the reference camera to " + few_of(apart) +
                             ": name another with --reference, or record a white target.");
  }
  if (!odd.empty()) {
    colors.reasons.push_back(fmt::format(
        "More than {:.0f} % of what is seen does not fit in {}: does the rig fit the take, and do "
        "its depths?",
        100 * kOdd, few_of(odd)));
  }
  constexpr double kDisagree = 2;  // CIEDE2000; an eye can tell 1
  if (colors.after.mean_difference > kDisagree) {
    colors.reasons.emplace_back(
        "The cameras do not agree about the same places even so: does the rig fit the take, and do "
        "its depths?");
  }
  if (!uncertain.empty()) {
    colors.reasons.push_back(fmt::format(
        "Half of the places alone say another thing, by more than {:.0f} % of the light, about {}: "
        "take a scene with light and dark surfaces, or record a white target.",
        100 * SceneColors::kMostUncertain, few_of(uncertain)));
  }
}

}  // namespace

SceneColors match_scene_colors(std::span<const SurfacePoint> points, const Rig& rig, int reference,
                               const std::stop_token& stop) {
  const auto check_stop = [&] {
    if (stop.stop_requested()) {
      throw Error::failed("the matching of colours was stopped", "", "Start it again");
    }
  };
  Fit fit(points, rig, static_cast<std::size_t>(reference));
  const auto all = [](std::size_t) { return true; };
  constexpr double kCoarse = 10, kFine = 2;
  for (const double scale : {kCoarse, kFine, kFine}) {
    check_stop();
    fit.solve(scale, all);
    leave_out_odd(fit, points.size());
  }
  check_stop();
  fit.solve(kFine, all);
  std::vector<double> uncertainty(rig.cameras.size(), 0);
  for (const std::size_t half : {0, 1}) {
    check_stop();
    Fit part = fit;
    constexpr std::size_t kTogether = 32;  // neighbours err alike
    part.solve(kFine, [&](std::size_t point) { return point / kTogether % 2 == half; });
    for (std::size_t c = 0; c < uncertainty.size(); ++c) {
      const double off = difference_of(fit.cameras()[c], part.cameras()[c]);
      uncertainty[c] = std::max(uncertainty[c], off);
    }
  }
  SceneColors colors;
  colors.what = "scene";
  colors.points = static_cast<int>(points.size());
  colors.uncertainty = std::ranges::max(uncertainty);
  colors.fits.resize(rig.cameras.size());
  int kept = 0;
  for (const Sight& sight : fit.sights()) {
    ++colors.fits[sight.camera].seen;
    colors.fits[sight.camera].kept += sight.counts ? 1 : 0;
    kept += sight.counts ? 1 : 0;
  }
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    PhotometricResponse& response = colors.responses.emplace_back(rig.cameras[c].photometric);
    for (std::size_t k = 0; k < 3; ++k) {
      response.contrast[k] = 1 / fit.cameras()[c][k];
      response.brightness[k] = fit.cameras()[c][3 + k];
    }
  }
  colors.before = spread_of(fit, fit.start());
  colors.after = spread_of(fit, fit.cameras());
  colors.findings.push_back(fmt::format(
      "Scene      {} places seen by {:.1f} cameras in the mean; {:.1f} % of the sights did not fit",
      points.size(), static_cast<double>(fit.sights().size()) / std::max(1.0, 1.0 * colors.points),
      100.0 * (static_cast<double>(fit.sights().size()) - kept) /
          static_cast<double>(std::max<std::size_t>(1, fit.sights().size()))));
  colors.findings.push_back(
      fmt::format("Sureness   half of the places alone would say the same within {:.2f} % of the "
                  "light in every camera",
                  100 * colors.uncertainty));
  judge(colors, rig, joined_to(static_cast<std::size_t>(reference), fit, points.size()),
        uncertainty);
  return colors;
}

}  // namespace raystage
