// SPDX-License-Identifier: Apache-2.0
// Reports of a colour match as text and JSON: deviations between the cameras and CIEDE2000
// differences before and after it.
#include "calibrate/color/color_match.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "schemas/document.h"
#include "schemas/former_names.h"

namespace raystage::calibrate {
namespace {

std::string spread_line(const char* when, const ColorSpread& spread) {
  return fmt::format(
      "{:<10} camera means differ by {:.2f} % in red, {:.2f} in green, {:.2f} in blue (one "
      "sigma); CIEDE2000 mean {:.2f}, maximum {:.2f}\n",
      when, 100 * spread.deviation[0], 100 * spread.deviation[1], 100 * spread.deviation[2],
      spread.mean_difference, spread.max_difference);
}

nlohmann::ordered_json spread_json(const ColorSpread& spread) {
  return {{"deviation", spread.deviation},
          {"mean_ciede2000", spread.mean_difference},
          {"max_ciede2000", spread.max_difference}};
}

nlohmann::ordered_json fit_json(const ColorFit& fit, const std::string& id) {
  nlohmann::ordered_json json{{"id", id},
                              {"observations", fit.observations},
                              {"inliers", fit.inliers},
                              {"mean_ciede2000", fit.mean_difference},
                              {"max_ciede2000", fit.max_difference}};
  if (fit.uncertainty > 0) json["uncertainty"] = fit.uncertainty;
  return json;
}

}  // namespace

double relative_deviation(const std::vector<schemas::Rgb>& of_cameras, std::size_t channel) {
  if (of_cameras.empty()) return 0;
  const auto count = static_cast<double>(of_cameras.size());
  double mean = 0, squares = 0;
  for (const schemas::Rgb& camera : of_cameras) {
    mean += camera[channel] / count;
    squares += camera[channel] * camera[channel] / count;
  }
  return std::sqrt(std::max(0.0, squares - mean * mean)) / mean;
}

std::string format_color_match(const std::vector<ColorMatch>& steps, const std::string& reference) {
  std::string text = fmt::format("Reference  {}\n", reference);
  for (const ColorMatch& step : steps) {
    if (steps.size() > 1) text += fmt::format("By         {}\n", step.what);
    text += spread_line("Before", step.before) + spread_line("After", step.after);
    for (const std::string& finding : step.findings) text += finding + "\n";
    for (const std::string& warning : step.warnings) text += "Warning    " + warning + "\n";
    for (const std::string& reason : step.reasons) text += "Rejected   " + reason + "\n";
  }
  return text;
}

std::string color_match_json(const std::vector<ColorMatch>& steps, const std::string& reference,
                             const std::vector<std::string>& cameras) {
  nlohmann::ordered_json json;
  const bool is_accepted =
      std::ranges::all_of(steps, [](const ColorMatch& step) { return step.reasons.empty(); });
  json["accepted"] = is_accepted;
  json["reference"] = reference;
  for (const ColorMatch& step : steps) {
    nlohmann::ordered_json fits = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < step.fits.size(); ++i)
      fits.push_back(fit_json(step.fits[i], cameras[i]));
    json["steps"].push_back({{"source", step.what},
                             {"before", spread_json(step.before)},
                             {"after", spread_json(step.after)},
                             {"cameras", fits},
                             {"findings", step.findings},
                             {"warnings", step.warnings},
                             {"reasons", step.reasons}});
  }
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    json["cameras"].push_back(
        {{"id", cameras[i]}, {"photometric", schemas::json_from(steps.back().responses[i])}});
  }
  constexpr schemas::FormerName kFormerNames[] = {{"accepted", "vouched_for"},
                                                  {"max_ciede2000", "most_ciede2000"},
                                                  {"observations", "seen"},
                                                  {"inliers", "kept"},
                                                  {"source", "by"}};
  schemas::add_former_names(json, kFormerNames);
  return json.dump(1) + "\n";
}

}  // namespace raystage::calibrate
