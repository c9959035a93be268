// SPDX-License-Identifier: Apache-2.0
// Formats calibrated lenses as text and as JSON.
#include "calibrate/lens_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "calibrate/geometry/model_selection.h"
#include "schemas/projection_names.h"

namespace raystage::calibrate {
namespace {

using Json = nlohmann::ordered_json;
using schemas::Projection;

/// Returns how a model compares with the one of the least error.
std::string_view rank_of(const LensModelComparison& comparison, std::size_t fit) {
  return model_rank(fit == comparison.best, comparison.fits[fit].is_worse);
}

std::string format_comparison(const LensModelComparison& comparison) {
  std::string text;
  for (std::size_t k = 0; k < comparison.fits.size(); ++k) {
    const LensModelFit& fit = comparison.fits[k];
    text += fmt::format("Model      {:<16} ", compared_model_name(fit.projection));
    if (!fit.failure.empty()) {
      text += "does not fit: " + fit.failure + "\n";
      continue;
    }
    text += fmt::format("{:.3f} px RMS of boards held out, {:.3f} of all, BIC {:+.0f}: {}\n",
                        fit.held_out_rms_px, fit.rms_px, fit.bic - comparison.best_fit().bic,
                        rank_of(comparison, k));
  }
  return text;
}

Json json_of(const LensModelComparison& comparison) {
  Json models = Json::array();
  for (std::size_t k = 0; k < comparison.fits.size(); ++k) {
    const LensModelFit& fit = comparison.fits[k];
    Json model{{"projection", schemas::name_of(fit.projection)}};
    if (!fit.failure.empty()) {
      model["failure"] = fit.failure;
    } else {
      model["held_out_rms_px"] = fit.held_out_rms_px;
      model["rms_px"] = fit.rms_px;
      model["bic"] = fit.bic;
      model["rank"] = rank_of(comparison, k);
    }
    models.push_back(std::move(model));
  }
  return models;
}

Json json_of(const CameraLens& lens) {
  const LensCalibration& found = lens.calibration;
  Json json{{"id", lens.id},
            {"accepted", found.reasons.empty()},
            {"rms_px", std::isfinite(found.rms_px) ? Json(found.rms_px) : Json()},
            {"views", found.views},
            {"corners", found.corners},
            {"outliers", found.outliers},
            {"projection", schemas::name_of(found.lens.projection)}};
  const LensParameters values = lens_parameters(found.lens);
  const auto& parameters = lens_parameterization(found.lens.projection).parameters();
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (parameters[k].name.empty()) continue;
    json["lens"][parameters[k].name] = values[k];
    json["lens_deviation"][parameters[k].name] = found.deviations[k];
  }
  json["image_coverage"] = found.image_coverage;
  json["max_tilt_deg"] = found.max_tilt_deg;
  if (lens.comparison) json["models"] = json_of(*lens.comparison);
  json["reasons"] = found.reasons;
  json["next_steps"] = found.next_steps;
  return json;
}

}  // namespace

std::string format_lens(const CameraLens& lens) {
  const LensCalibration& found = lens.calibration;
  std::string text =
      fmt::format("Camera     {}: {:.3f} px RMS over {} corners in {} views, {} outliers\n",
                  lens.id, found.rms_px, found.corners, found.views, found.outliers);
  if (lens.comparison) text += format_comparison(*lens.comparison);
  if (found.lens.projection != Projection::kPinhole) {
    text += fmt::format("Lens       {}\n", schemas::name_of(found.lens.projection));
  }
  const LensParameters values = lens_parameters(found.lens);
  const auto& parameters = lens_parameterization(found.lens.projection).parameters();
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (found.deviations[k] == 0 && values[k] == 0) continue;
    text += fmt::format("Lens       {} {:.5g} +- {:.2g}\n", parameters[k].name, values[k],
                        found.deviations[k]);
  }
  text += fmt::format("Coverage   {:.0f} % of the picture, tilts up to {:.0f} degrees\n",
                      100 * found.image_coverage, found.max_tilt_deg);
  for (const std::string& reason : found.reasons) text += "Rejected   " + reason + "\n";
  for (const std::string& step : found.next_steps) text += "Next       " + step + "\n";
  return text;
}

std::string lens_report_json(std::span<const CameraLens> lenses) {
  Json json{{"accepted", std::ranges::all_of(lenses, [](const CameraLens& lens) {
               return lens.calibration.reasons.empty();
             })}};
  json["cameras"] = Json::array();
  for (const CameraLens& lens : lenses) json["cameras"].push_back(json_of(lens));
  return json.dump(1) + "\n";
}

}  // namespace raystage::calibrate
