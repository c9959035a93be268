// SPDX-License-Identifier: Apache-2.0
// Chooses the lens model of an array by points that were held out, as lens_comparison.h does for a
// single lens by boards. Input: detections; output: an error for each model. Cost: two calibrations
// of half of the points per model.
#include "calibrate/array_lens_models.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <utility>

#include "base/error.h"
#include "calibrate/geometry/lens_comparison.h"
#include "calibrate/geometry/model_selection.h"
#include "calibrate/geometry/triangulation.h"
#include "charts/html_page.h"
#include "schemas/projection_names.h"

namespace raystage::calibrate {
namespace {

using schemas::Projection;

constexpr double kMostErrorPx = 3;

/// By the number of the point, or of the board: the corners of a board share its errors.
using ErrorsByGroup = std::map<int, HeldOutError>;

int points_in_group(const BoardObjectPoints& board) {
  return board.empty() ? 1 : static_cast<int>(board.size());
}

/// Returns the detections of the points in one half: every second point, or board.
Detections half_of(const Detections& detections, const BoardObjectPoints& board, int half) {
  const int group = points_in_group(board);
  Detections part{detections.cameras, {}};
  // By order, not by number: frames that were thinned out may all be even.
  int order = -1, last = -1;
  for (const Detections::Detection& detection : detections.detections) {
    if (order < 0 || detection.point / group != last) ++order;
    last = detection.point / group;
    if (order % 2 == half) part.detections.push_back(detection);
  }
  return part;
}

/// Adds the errors of points with calibrated cameras, and their displacements by the distortion
/// terms where both models show them.
void add_errors(const ArrayModel& calibrated, const Detections& held_out, int group,
                ErrorsByGroup& errors, HeldOutError& displacement) {
  ArrayModel model = make_initial_model(held_out, 1);
  for (std::size_t i = 0; i < model.cameras.size(); ++i) {
    model.cameras[i].intrinsics = calibrated.cameras[i].intrinsics;
    model.cameras[i].pose = calibrated.cameras[i].pose;
  }
  triangulate_points(model, 1e3);
  const CameraModels lenses = camera_models(model);
  ArrayModel ideal = model;
  for (ArrayModel::Camera& camera : ideal.cameras) {
    camera.intrinsics.distortion = {};
    camera.intrinsics.radial_distortion = {};
  }
  const CameraModels undistorted = camera_models(ideal);
  for (const ArrayModel::Observation& observation : model.observations) {
    HeldOutError& error =
        errors[model.point_ids[static_cast<std::size_t>(observation.point)] / group];
    double squared = kMostErrorPx * kMostErrorPx;
    if (model.counts(observation)) {
      const auto residual = reprojection_residual(model, lenses, observation);
      if (residual) squared = std::min(squared, residual->squaredNorm());
    }
    error.sum += squared;
    ++error.count;
    const auto camera = static_cast<std::size_t>(observation.camera);
    const auto ray = lenses[camera].unproject(observation.pixel);
    const auto moved = ray ? undistorted[camera].project(*ray) : std::nullopt;
    if (!moved) continue;
    displacement.sum += (*moved - observation.pixel).squaredNorm();
    ++displacement.count;
  }
}

/// Returns whether points or boards fit a model worse than another one.
bool fit_worse_in_common(const ErrorsByGroup& model, const ErrorsByGroup& other) {
  std::vector<HeldOutError> of_model, of_other;
  for (const auto& [group, error] : model) {
    const auto found = other.find(group);
    if (found == other.end()) continue;
    of_model.push_back(error);
    of_other.push_back(found->second);
  }
  return fit_worse(of_model, of_other);
}

std::string_view fit_rank(const ArrayLensModelComparison& comparison, std::size_t fit) {
  return model_rank(fit == comparison.best, comparison.fits[fit].is_worse);
}

}  // namespace

CalibrationOptions with_lens_model(CalibrationOptions options, std::size_t cameras,
                                   Projection projection) {
  std::vector<LensModel>& models = options.solve.lens_models;
  models.resize(cameras);
  for (LensModel& model : models) {
    model.projection = projection;
    if (projection == Projection::kPinhole) model.half_angle.reset();
  }
  return options;
}

ArrayLensModelComparison compare_array_lens_models(const Detections& detections,
                                                   const CalibrationOptions& options) {
  ArrayLensModelComparison comparison;
  comparison.are_boards = !options.board.empty();
  std::vector<ErrorsByGroup> errors;
  for (const Projection projection : compared_projections()) {
    ArrayLensModelFit& fit = comparison.fits.emplace_back();
    ErrorsByGroup& of_model = errors.emplace_back();
    fit.projection = projection;
    CalibrationOptions settings = with_lens_model(options, detections.cameras.size(), projection);
    settings.solve.on_step = {};
    try {
      HeldOutError displacement;
      for (int half = 0; half < 2; ++half) {
        const Calibration found = calibrate(half_of(detections, options.board, half), settings);
        const Detections held_out = half_of(detections, options.board, 1 - half);
        add_errors(found.model, held_out, points_in_group(options.board), of_model, displacement);
      }
      std::vector<HeldOutError> all;
      for (const auto& [group, error] : of_model) all.push_back(error);
      fit.held_out_rms_px = rms_of(all);
      fit.distortion_px = rms_of({&displacement, 1});
      comparison.held_out = static_cast<int>(of_model.size());
    } catch (const Error& error) {
      if (options.solve.stop.stop_requested()) throw;
      fit.failure = error.what();
      fit.held_out_rms_px = std::numeric_limits<double>::infinity();
      of_model.clear();
    }
  }
  const auto least =
      std::ranges::min_element(comparison.fits, {}, &ArrayLensModelFit::held_out_rms_px);
  if (!least->failure.empty()) {
    throw Error::bad_input("no lens model fits half of the detections: " + least->failure, "",
                           "Record more, or choose one lens model")
        .concerning({"lens_model"});
  }
  const auto of_least = static_cast<std::size_t>(least - comparison.fits.begin());
  std::vector<bool> is_worse;
  std::vector<double> distortions;
  for (std::size_t k = 0; k < comparison.fits.size(); ++k) {
    ArrayLensModelFit& fit = comparison.fits[k];
    fit.is_worse =
        !fit.failure.empty() || (k != of_least && fit_worse_in_common(errors[k], errors[of_least]));
    is_worse.push_back(fit.is_worse);
    distortions.push_back(fit.distortion_px);
  }
  comparison.best = simplest_model(is_worse, distortions).value_or(of_least);
  return comparison;
}

ArrayLensModelComparison compare_track_lens_models(const RecordedTracks& tracks,
                                                   const TrackCalibrationOptions& options) {
  std::vector<Projection> order(compared_projections().begin(), compared_projections().end());
  std::stable_partition(order.begin(), order.end(),
                        [](Projection projection) { return projection == Projection::kFisheye; });
  std::string failure;
  for (const Projection projection : order) {
    TrackCalibrationOptions settings = options;
    settings.calibration = with_lens_model(options.calibration, tracks.cameras.size(), projection);
    settings.calibration.solve.on_step = {};
    try {
      const TrackCalibration found = calibrate_from_tracks(tracks, settings);
      return compare_array_lens_models(found.points.detections, options.calibration);
    } catch (const Error& error) {
      if (options.calibration.solve.stop.stop_requested()) throw;
      failure = error.what();
    }
  }
  throw Error::bad_input("no lens model fits the take: " + failure, "",
                         "Record more, or choose one lens model")
      .concerning({"lens_model"});
}

std::string format_array_lens_models(const ArrayLensModelComparison& comparison) {
  std::string text;
  for (std::size_t k = 0; k < comparison.fits.size(); ++k) {
    const ArrayLensModelFit& fit = comparison.fits[k];
    text += fmt::format("Model      {:<16} ", compared_model_name(fit.projection));
    text += fit.failure.empty()
                ? fmt::format("{:.3f} px RMS of {} {} held out: {}\n", fit.held_out_rms_px,
                              comparison.held_out, comparison.are_boards ? "boards" : "points",
                              fit_rank(comparison, k))
                : "does not fit: " + fit.failure + "\n";
  }
  return text;
}

std::string lens_models_html(const ArrayLensModelComparison& comparison) {
  std::string rows;
  for (std::size_t k = 0; k < comparison.fits.size(); ++k) {
    const ArrayLensModelFit& fit = comparison.fits[k];
    rows += fmt::format(
        "<tr><td>{}</td>{}</tr>\n", compared_model_name(fit.projection),
        fit.failure.empty()
            ? fmt::format("<td>{:.3f}</td><td>{}</td>", fit.held_out_rms_px,
                          fit_rank(comparison, k))
            : fmt::format("<td></td><td>does not fit: {}</td>", charts::escape_html(fit.failure)));
  }
  return charts::html_section(
      "Lens models",
      fmt::format("Reprojection error of {} {} that were held out, each once. Of models that these "
                  "do not distinguish, the pinhole or the one with the least distortion is used.",
                  comparison.held_out, comparison.are_boards ? "boards" : "points"),
      "<div class=\"scroll\"><table><thead><tr><th>model</th><th>held out, px RMS</th><th></th>"
      "</tr></thead><tbody>\n" +
          rows + "</tbody></table></div>\n");
}

std::string with_lens_models_json(const std::string& report,
                                  const ArrayLensModelComparison& comparison) {
  nlohmann::ordered_json json = nlohmann::ordered_json::parse(report);
  json["models"] = nlohmann::ordered_json::array();
  for (std::size_t k = 0; k < comparison.fits.size(); ++k) {
    const ArrayLensModelFit& fit = comparison.fits[k];
    nlohmann::ordered_json model{{"projection", schemas::name_of(fit.projection)}};
    if (!fit.failure.empty()) {
      model["failure"] = fit.failure;
    } else {
      model["held_out_rms_px"] = fit.held_out_rms_px;
      model["rank"] = fit_rank(comparison, k);
    }
    json["models"].push_back(std::move(model));
  }
  return json.dump(1) + "\n";
}

}  // namespace raystage::calibrate
