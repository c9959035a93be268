// SPDX-License-Identifier: Apache-2.0
// Formats the result of a calibration as text and as JSON.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "calibrate/geometry/calibration_report.h"
#include "schemas/former_names.h"

namespace raystage::calibrate {
namespace {

using Json = nlohmann::ordered_json;
Json number(double value) { return std::isfinite(value) ? Json(value) : Json(); }

Json json_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json camera_json(const Calibration& calibration, std::size_t i, const CameraFit& fit) {
  const ArrayModel::Camera& camera = calibration.model.cameras[i];
  Json json{{"id", camera.id},
            {"found", camera.pose.has_value()},
            {"observations", fit.observations},
            {"inliers", fit.inliers}};
  json["rms_px"] = number(fit.rms_px);
  json["image_coverage"] = fit.image_coverage;
  if (i < calibration.line_times.cameras.size()) {
    const LineTimes::Camera& line = calibration.line_times.cameras[i];
    json["line_time"] = {{"source", name_of(line.source)},
                         {"us", line.us},
                         {"estimate_us", line.estimate_us},
                         {"deviation_us", line.deviation_us}};
  }
  if (!camera.pose) return json;
  json["position"] = json_of(camera.pose->position);
  const LensParameters lens = lens_parameters(camera.intrinsics);
  const auto& parameters = lens_parameterization(camera.intrinsics.projection).parameters();
  json["projection"] = schemas::name_of(camera.intrinsics.projection);
  for (std::size_t k = 0; k < lens.size(); ++k) {
    if (!parameters[k].name.empty()) json["lens"][parameters[k].name] = lens[k];
  }
  if (!calibration.uncertainty || !calibration.uncertainty->cameras[i]) return json;
  const Uncertainty::Camera& deviation = *calibration.uncertainty->cameras[i];
  json["position_deviation"] = json_of(deviation.position);
  json["rotation_deviation_deg"] = json_of(deviation.rotation_deg);
  for (std::size_t k = 0; k < lens.size(); ++k) {
    if (!parameters[k].name.empty()) json["lens_deviation"][parameters[k].name] = deviation.lens[k];
  }
  return json;
}

}  // namespace

std::string calibration_report_json(const Calibration& calibration) {
  const ArrayModel& model = calibration.model;
  const std::vector<CameraFit> fits = camera_fits(model);
  const Overlap overlap = compute_overlap(model);
  Json json{{"accepted", calibration.verdict.is_accepted()},
            {"reasons", calibration.verdict.reasons},
            {"warnings", calibration.verdict.warnings},
            {"next_steps", calibration.verdict.next_steps}};
  json["rms_px"] = number(rms_reprojection_error(model));
  json["noise_px"] = calibration.uncertainty ? Json(calibration.uncertainty->noise_px) : Json();
  json["residual_correlation"] =
      calibration.uncertainty ? Json(calibration.uncertainty->correlation) : Json();
  json["detections"] = model.observations.size();
  json["outliers"] =
      std::ranges::count_if(model.observations, [](const auto& o) { return o.is_outlier; });
  json["points"] = model.points.size();
  json["merged_points"] = calibration.merged_points;
  json["scale_source"] = calibration.scale_is_known ? Json(calibration.scale_source) : Json();
  json["spacing"] = camera_spacing(model);
  json["seconds"] = calibration.solve.seconds;
  Json steps = Json::array(), cameras = Json::array(), pairs = Json::array(), weak = Json::array();
  for (const SolveReport::Step& step : calibration.solve.steps) {
    steps.push_back({{"name", step.what},
                     {"rms_px", number(step.rms_px)},
                     {"detections", step.observations},
                     {"outliers", step.outliers}});
  }
  for (std::size_t i = 0; i < fits.size(); ++i) {
    cameras.push_back(camera_json(calibration, i, fits[i]));
  }
  for (std::size_t a = 0; a < fits.size(); ++a) {
    for (std::size_t b = a + 1; b < fits.size(); ++b) {
      pairs.push_back({model.cameras[a].id, model.cameras[b].id, overlap.shared[a][b]});
    }
  }
  if (calibration.uncertainty) {
    for (const Uncertainty::Direction& direction : calibration.uncertainty->weakest) {
      weak.push_back({{"description", describe_direction(direction, model)},
                      {"tolerances", direction.deviation}});
    }
  }
  json["steps"] = std::move(steps);
  json["cameras"] = std::move(cameras);
  json["weakest"] = std::move(weak);
  json["common_points"] = std::move(pairs);
  constexpr schemas::FormerName kFormerNames[] = {{"accepted", "vouched_for"},
                                                  {"observations", "points_seen"},
                                                  {"inliers", "points_kept"},
                                                  {"image_coverage", "picture_covered"},
                                                  {"position", "place"},
                                                  {"position_deviation", "place_deviation"},
                                                  {"rotation_deviation_deg", "turn_deviation_deg"},
                                                  {"merged_points", "points_merged"},
                                                  {"scale_source", "scale_from"},
                                                  {"name", "what"},
                                                  {"description", "what"}};
  schemas::add_former_names(json, kFormerNames);
  return json.dump(1) + "\n";
}

std::string format_calibration_report(const Calibration& calibration) {
  const ArrayModel& model = calibration.model;
  const std::vector<CameraFit> fits = camera_fits(model);
  std::string text;
  const auto line = [&](const std::string& s) { text += s + "\n"; };
  const auto outliers =
      std::ranges::count_if(model.observations, [](const auto& o) { return o.is_outlier; });
  line(fmt::format(
      "Detections {} of {} points by {} cameras; {} outliers ({:.1f} %)", model.observations.size(),
      model.points.size(), model.cameras.size(), outliers,
      100.0 * outliers / static_cast<double>(std::max<std::size_t>(model.observations.size(), 1))));
  if (calibration.merged_points > 0) {
    line(fmt::format("           {} more positions of a resting light were merged",
                     calibration.merged_points));
  }
  for (const SolveReport::Step& step : calibration.solve.steps) {
    line(fmt::format("Step       {:<40} {:.3f} px RMS", step.what, step.rms_px));
  }
  line(fmt::format("Fit        {:.3f} px RMS in {:.1f} s", rms_reprojection_error(model),
                   calibration.solve.seconds));
  const char* unit = calibration.scale_is_known ? "m" : "units of unknown scale";
  line(fmt::format("Spacing    {:.5g} {}{}", camera_spacing(model), unit,
                   calibration.grid ? ", in a grid" : ""));
  if (calibration.scale_is_known) line("Scale      from " + calibration.scale_source);
  text += format_line_times(calibration.line_times, model);
  double position = 0, turn = 0, focal = 0;
  for (const auto& camera : calibration.uncertainty ? calibration.uncertainty->cameras
                                                    : decltype(Uncertainty::cameras){}) {
    if (!camera) continue;
    position = std::max(position, camera->position.norm());
    turn = std::max(turn, camera->rotation_deg.norm());
    focal = std::max(focal, camera->lens[0]);
  }
  if (calibration.uncertainty) {
    line(fmt::format(
        "Deviations at most {:.2g} {} in position, {:.2g} degrees in rotation, {:.2g} px "
        "in focal length (one sigma)",
        position, unit, turn, focal));
  }
  const auto empty = compute_overlap(model).pairs_without_points();
  if (!empty.empty()) {
    std::vector<std::string> names;
    for (const auto& [a, b] : empty) {
      names.push_back(model.cameras[a].id + "-" + model.cameras[b].id);
    }
    line(fmt::format("Overlap    {} pairs of cameras share no points: {}", empty.size(),
                     abbreviate_list(names)));
  }
  constexpr std::size_t kAllShown = 16;
  std::vector<std::size_t> order(fits.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  if (fits.size() > kAllShown) {
    std::ranges::stable_sort(
        order, [&](std::size_t a, std::size_t b) { return fits[a].rms_px > fits[b].rms_px; });
    order.resize(kAllShown);
    line(fmt::format("Cameras    the {} with the largest errors (the JSON report has all)",
                     kAllShown));
  }
  for (const std::size_t i : order) {
    line(fmt::format("Camera     {:<12} {:.3f} px RMS, {} of {} points{}", model.cameras[i].id,
                     fits[i].rms_px, fits[i].inliers, fits[i].observations,
                     model.cameras[i].pose ? "" : ", no pose"));
  }
  for (const std::string& warning : calibration.verdict.warnings) line("Warning    " + warning);
  for (const std::string& reason : calibration.verdict.reasons) line("Rejected   " + reason);
  for (const std::string& step : calibration.verdict.next_steps) line("Next       " + step);
  if (calibration.verdict.is_accepted()) line("Verdict    accepted");
  return text;
}

}  // namespace raystage::calibrate
