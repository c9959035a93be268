// SPDX-License-Identifier: Apache-2.0
// Compares lens models by boards that were held out of the calibration (cross-validation in two
// halves) and by the Bayesian information criterion. Errors are truncated, so that every model has
// the same corners. Cost: three calibrations for each model.
#include "calibrate/geometry/lens_comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "base/error.h"
#include "base/options.h"
#include "calibrate/geometry/board_view_model.h"
#include "calibrate/geometry/bundle_adjustment.h"
#include "calibrate/geometry/model_selection.h"

namespace raystage::calibrate {
namespace {

using schemas::Projection;

/// Fits the poses of the boards to a lens and returns the errors of each.
std::vector<HeldOutError> board_errors(const CameraBoardViews& camera,
                                       const schemas::Intrinsics& lens,
                                       const LensCalibrationOptions& options) {
  const BoardViewList views({&camera, 1});
  ArrayModel model = make_board_view_model(views, {&camera, 1}, {&lens, 1});
  place_boards(model, views);
  BundleAdjustmentOptions poses;
  poses.fixed_cameras = {true};
  poses.stop = options.stop;
  run_bundle_adjustment(model, poses);
  const CameraModels lenses = camera_models(model);
  std::vector<HeldOutError> errors(model.bodies.size());
  for (std::size_t b = 0, i = 0; b < model.bodies.size(); ++b) {
    for (std::size_t k = 0; k < model.bodies[b].points.size(); ++k, ++i) {
      const auto residual = reprojection_residual(model, lenses, model.observations[i]);
      const double error =
          residual ? std::min(residual->norm(), options.max_error_px) : options.max_error_px;
      errors[b].sum += error * error;
      ++errors[b].count;
    }
  }
  return errors;
}

double bic_of(std::span<const HeldOutError> errors, const LensCalibrationOptions& options) {
  double coordinates = 0;
  for (const HeldOutError& board : errors) coordinates += 2.0 * board.count;
  const LensRefinement freedom =
      options.full_lens_model ? LensRefinement::kFullModel : LensRefinement::kRadial;
  constexpr std::size_t kOfPose = 6;
  const auto parameters = static_cast<double>(
      kLensParameterCount - fixed_lens_parameters(freedom, options.model.projection).size() +
      kOfPose * errors.size());
  const double mean = std::max(std::pow(rms_of(errors), 2) / 2, 1e-12);
  return coordinates * std::log(mean) + parameters * std::log(coordinates);
}

/// Returns the errors of the boards with the lens from the other half of them.
std::vector<HeldOutError> held_out_errors(const CameraBoardViews& camera,
                                          const LensCalibrationOptions& options) {
  std::array<CameraBoardViews, 2> halves;
  for (CameraBoardViews& half : halves) {
    half.id = camera.id;
    half.width = camera.width;
    half.height = camera.height;
  }
  for (std::size_t i = 0; i < camera.views.size(); ++i) {
    halves[i % 2].views.push_back(camera.views[i]);
  }
  std::vector<HeldOutError> errors;
  for (std::size_t half = 0; half < 2; ++half) {
    const LensCalibration lens = calibrate_lens(halves[1 - half], options);
    const std::vector<HeldOutError> of_half = board_errors(halves[half], lens.lens, options);
    errors.insert(errors.end(), of_half.begin(), of_half.end());
  }
  return errors;
}

/// Returns the RMS displacement of the corners by the distortion, pixels.
double distortion_px(const CameraBoardViews& camera, const schemas::Intrinsics& lens) {
  schemas::Intrinsics ideal = lens;
  ideal.distortion = {};
  ideal.radial_distortion = {};
  const auto model_of = [&](const schemas::Intrinsics& of_lens) {
    return rig::CameraModel({camera.id, camera.width, camera.height, of_lens, {}, {}, {}});
  };
  const rig::CameraModel distorted = model_of(lens), undistorted = model_of(ideal);
  double sum = 0;
  int count = 0;
  for (const BoardView& view : camera.views) {
    for (const Eigen::Vector2d& pixel : view.pixels) {
      const auto ray = distorted.unproject(pixel);
      const auto moved = ray ? undistorted.project(*ray) : std::nullopt;
      if (!moved) continue;
      sum += (*moved - pixel).squaredNorm();
      ++count;
    }
  }
  return std::sqrt(sum / std::max(count, 1));
}

/// Returns the views with enough corners, so that halves and boards correspond between models.
CameraBoardViews usable_views(const CameraBoardViews& camera) {
  const BoardViewList views({&camera, 1});
  constexpr std::size_t kLeast = 8;
  if (views.views.size() < kLeast) {
    throw Error::bad_input(
        fmt::format("camera \"{}\" has {} usable frames of the board; to compare lens models it "
                    "needs at least {}",
                    camera.id, views.views.size(), kLeast),
        "", "Record more of the board, or choose one lens model")
        .concerning({"board", "lens_model"});
  }
  CameraBoardViews usable{camera.id, camera.width, camera.height, {}};
  for (const BoardView* view : views.views) usable.views.push_back(*view);
  return usable;
}

}  // namespace

std::span<const Projection> compared_projections() {
  static constexpr std::array<Projection, 4> kAll{Projection::kPinhole, Projection::kFisheye,
                                                  Projection::kEquisolid,
                                                  Projection::kOrthographic};
  return kAll;
}

LensModelComparison compare_lens_models(const CameraBoardViews& camera,
                                        const LensCalibrationOptions& options) {
  require_valid(options, "comparison of lens models");
  const CameraBoardViews usable = usable_views(camera);
  LensModelComparison comparison;
  std::vector<std::vector<HeldOutError>> held_out;
  for (const Projection projection : compared_projections()) {
    LensModelFit& fit = comparison.fits.emplace_back();
    held_out.emplace_back();
    fit.projection = projection;
    LensCalibrationOptions of_model = options;
    of_model.model.projection = projection;
    if (projection == Projection::kPinhole) of_model.model.half_angle.reset();
    try {
      fit.calibration = calibrate_lens(usable, of_model);
      const auto errors = board_errors(usable, fit.calibration.lens, of_model);
      fit.rms_px = rms_of(errors);
      fit.bic = bic_of(errors, of_model);
      fit.distortion_px = distortion_px(usable, fit.calibration.lens);
      held_out.back() = held_out_errors(usable, of_model);
      fit.held_out_rms_px = rms_of(held_out.back());
    } catch (const Error& error) {
      if (options.stop.stop_requested()) throw;
      fit.failure = error.what();
      fit.held_out_rms_px = std::numeric_limits<double>::infinity();
    }
  }
  const auto least = std::ranges::min_element(comparison.fits, {}, &LensModelFit::held_out_rms_px);
  if (!least->failure.empty()) {
    throw Error::bad_input(
        "no lens model fits the boards of camera \"" + camera.id + "\": " + least->failure, "",
        "Check the size of the board and of its squares")
        .concerning({"board", "square_mm"});
  }
  const auto of_least = static_cast<std::size_t>(least - comparison.fits.begin());
  std::vector<bool> is_worse;
  std::vector<double> distortions;
  for (std::size_t k = 0; k < comparison.fits.size(); ++k) {
    LensModelFit& fit = comparison.fits[k];
    fit.is_worse =
        held_out[k].empty() || (k != of_least && fit_worse(held_out[k], held_out[of_least]));
    is_worse.push_back(fit.is_worse);
    distortions.push_back(fit.distortion_px);
  }
  comparison.best = simplest_model(is_worse, distortions).value_or(of_least);
  return comparison;
}

Projection best_common_projection(std::span<const LensModelComparison> cameras) {
  const std::size_t count = compared_projections().size();
  std::vector<bool> is_worse(count, false);
  std::vector<double> distortions(count, 0), errors(count, 0);
  for (const LensModelComparison& camera : cameras) {
    for (std::size_t k = 0; k < count; ++k) {
      is_worse[k] = is_worse[k] || camera.fits[k].is_worse;
      distortions[k] += camera.fits[k].distortion_px;
      errors[k] += std::pow(camera.fits[k].held_out_rms_px, 2);
    }
  }
  const auto least = static_cast<std::size_t>(std::ranges::min_element(errors) - errors.begin());
  return compared_projections()[simplest_model(is_worse, distortions).value_or(least)];
}

}  // namespace raystage::calibrate
