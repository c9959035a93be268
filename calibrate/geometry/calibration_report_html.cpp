// SPDX-License-Identifier: Apache-2.0
// Formats the result of a calibration as a self-contained HTML page.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calibrate/geometry/calibration_report.h"
#include "charts/html_page.h"
#include "charts/svg_chart.h"

namespace raystage::calibrate {
namespace {

constexpr std::string_view kStyle = R"(
.verdict { margin:0 0 40px; padding:0; list-style:none; max-width:100ch }
.verdict li { padding:5px 0 5px 18px; border-left:2px solid var(--rule) }
.verdict li:first-child { font-size:19px; border-color:var(--amber) }
svg .fit { fill:var(--teal) }
svg .lost { fill:var(--red) }
svg .few { fill:var(--amber) }
svg .camera { fill:var(--teal) }
svg .way { stroke:var(--teal); stroke-width:1.2 }
svg .frame { fill:none; stroke:var(--rule); stroke-width:1 }
svg .error { stroke:var(--teal); stroke-width:1 }
svg .large { stroke:var(--amber); stroke-width:1 }
svg .seen { fill:var(--soft) }
svg .shared { fill:var(--teal) }
svg .nothing { fill:var(--red); fill-opacity:.55 }
.fields { display:grid; grid-template-columns:repeat(auto-fill,minmax(150px,1fr)); gap:14px 12px }
.fields figure { margin:0 } .fields figcaption { font-size:12px; color:var(--soft) }
.scroll { overflow-x:auto }
)";

std::string verdict_list(const CalibrationVerdict& verdict) {
  std::string items =
      fmt::format("<li>{}</li>", verdict.is_accepted() ? "This calibration is accepted."
                                                       : "This calibration is rejected.");
  const auto add = [&](const char* lead, const std::vector<std::string>& sentences) {
    for (const std::string& s : sentences) {
      items += fmt::format("<li>{}{}</li>", lead, charts::escape_html(s));
    }
  };
  add("", verdict.reasons);
  add("Weak: ", verdict.warnings);
  add("Next: ", verdict.next_steps);
  return "<ul class=\"verdict\">" + items + "</ul>";
}

std::string facts(const Calibration& calibration) {
  const ArrayModel& model = calibration.model;
  const auto outliers =
      std::ranges::count_if(model.observations, [](const auto& o) { return o.is_outlier; });
  std::string html = "<div class=\"facts\">";
  const auto fact = [&](const std::string& value, const char* what) {
    html += fmt::format("<div><b>{}</b>{}</div>", value, what);
  };
  fact(fmt::format("{:.3f} px", rms_reprojection_error(model)), "RMS of the inliers");
  fact(fmt::format("{}", model.cameras.size()), "cameras");
  fact(fmt::format("{}", model.points.size()), "points");
  fact(fmt::format("{}", model.observations.size()), "detections");
  fact(fmt::format("{:.1f} %",
                   100.0 * outliers /
                       static_cast<double>(std::max<std::size_t>(model.observations.size(), 1))),
       "outliers");
  fact(calibration.scale_is_known ? fmt::format("{:.1f} mm", 1000 * camera_spacing(model))
                                  : std::string("unknown"),
       "camera spacing");
  double least = 0, most = 0;  // of rolling shutters
  for (const LineTimes::Camera& camera : calibration.line_times.cameras) {
    if (camera.us == 0) continue;
    least = least == 0 ? camera.us : std::min(least, camera.us);
    most = most == 0 ? camera.us : std::max(most, camera.us);
  }
  if (least != 0) {
    fact(least == most ? fmt::format("{:.2f} us", least)
                       : fmt::format("{:.2f} to {:.2f} us", least, most),
         "line time of rolling shutters");
  }
  return html + "</div>";
}

std::string fit_chart(const Calibration& calibration, const std::vector<CameraFit>& fits) {
  double most = 0.1;
  for (const CameraFit& fit : fits) {
    if (std::isfinite(fit.rms_px)) most = std::max(most, fit.rms_px);
  }
  const auto count = static_cast<double>(fits.size());
  charts::SvgChart chart("RMS reprojection error of each camera", {-0.5, count - 0.5, "", false},
                         {0, 1.15 * most, "RMS, px", true});
  for (std::size_t i = 0; i < fits.size(); ++i) {
    const auto x = static_cast<double>(i);
    const std::string& id = calibration.model.cameras[i].id;
    if (std::isfinite(fits[i].rms_px)) {
      chart.bar(x - 0.4, x + 0.4, 0, fits[i].rms_px, "fit",
                fmt::format("{}: {:.3f} px", id, fits[i].rms_px));
    }
    chart.x_label(x, id, fits.size() > 12);
  }
  return chart.str();
}

std::string points_chart(const Calibration& calibration, const std::vector<CameraFit>& fits) {
  int most = 1;
  for (const CameraFit& fit : fits) most = std::max(most, fit.observations);
  const auto count = static_cast<double>(fits.size());
  charts::SvgChart chart("Points of each camera", {-0.5, count - 0.5, "", false},
                         {0, 1.1 * most, "points", true});
  for (std::size_t i = 0; i < fits.size(); ++i) {
    const auto x = static_cast<double>(i);
    const std::string& id = calibration.model.cameras[i].id;
    const std::string title =
        fmt::format("{}: {} of {}", id, fits[i].inliers, fits[i].observations);
    chart.bar(x - 0.4, x + 0.4, 0, fits[i].inliers, "fit", title);
    chart.bar(x - 0.4, x + 0.4, fits[i].inliers, fits[i].observations, "lost", title);
    chart.x_label(x, id, fits.size() > 12);
  }
  return chart.str();
}

/// Draws the residuals in one camera's picture, enlarged `kDrawn` times.
std::string residual_field(const Calibration& calibration, std::size_t index,
                           const CameraModels& lenses, const CameraFit& fit, double drawn) {
  const ArrayModel::Camera& camera = calibration.model.cameras[index];
  constexpr std::size_t kMaxLines = 250;
  const std::size_t step = static_cast<std::size_t>(fit.observations) / kMaxLines + 1;
  std::string lines;
  std::size_t k = 0;
  for (const ArrayModel::Observation& o : calibration.model.observations) {
    if (static_cast<std::size_t>(o.camera) != index || k++ % step != 0) continue;
    if (!calibration.model.counts(o)) {
      lines += fmt::format("<circle class=\"lost\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\"/>",
                           o.pixel.x(), o.pixel.y(), camera.width / 160);
      continue;
    }
    const auto residual = reprojection_residual(calibration.model, lenses, o);
    if (!residual) continue;
    const Eigen::Vector2d to = o.pixel + drawn * *residual;
    lines += fmt::format("<circle class=\"seen\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\"/>",
                         o.pixel.x(), o.pixel.y(), camera.width / 250.0);
    lines += fmt::format(
        "<line class=\"{}\" vector-effect=\"non-scaling-stroke\" x1=\"{:.1f}\" y1=\"{:.1f}\" "
        "x2=\"{:.1f}\" y2=\"{:.1f}\"/>",
        residual->norm() > 3 * fit.rms_px ? "large" : "error", o.pixel.x(), o.pixel.y(), to.x(),
        to.y());
  }
  return fmt::format(
      "<figure><svg viewBox=\"0 0 {0} {1}\" role=\"img\" aria-label=\"Residuals of {2}\"><rect "
      "class=\"frame\" vector-effect=\"non-scaling-stroke\" width=\"{0}\" height=\"{1}\"/>{3}"
      "</svg><figcaption>{2} {4:.2f} px</figcaption></figure>",
      camera.width, camera.height, charts::escape_html(camera.id), lines, fit.rms_px);
}

std::string residual_fields(const Calibration& calibration, const std::vector<CameraFit>& fits) {
  const CameraModels lenses = camera_models(calibration.model);
  const double rms = rms_reprojection_error(calibration.model);
  const double width = calibration.model.cameras.front().width;
  const double drawn = rms > 0 ? width / 25 / rms : 1;
  std::string fields = "<div class=\"fields\">";
  for (std::size_t i = 0; i < fits.size(); ++i) {
    if (fits[i].observations > 0) fields += residual_field(calibration, i, lenses, fits[i], drawn);
  }
  return charts::html_section(
      "Residuals in the pictures",
      fmt::format(
          "Residuals from the observation (dot), away from the projected point, enlarged "
          "{:.0f} times; red dots are outliers. Arrows that point the same way side by "
          "side are an error of the lens or of the pose; arrows in all directions are noise.",
          drawn),
      fields + "</div>");
}

std::string overlap_chart(const Calibration& calibration) {
  const Overlap overlap = compute_overlap(calibration.model);
  const std::size_t count = overlap.shared.size();
  int most = 1;
  for (const auto& row : overlap.shared) {
    for (const int shared : row) most = std::max(most, shared);
  }
  const double cell = 1;
  const auto size = static_cast<double>(count);
  std::string cells;
  for (std::size_t a = 0; a < count; ++a) {
    for (std::size_t b = 0; b < count; ++b) {
      if (a == b) continue;
      const int shared = overlap.shared[a][b];
      const double opacity = shared == 0 ? 1 : 0.08 + 0.92 * shared / most;
      cells += fmt::format(
          "<rect class=\"{}\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"{}><title>{} and {}: "
          "{}</title></rect>",
          shared == 0 ? "nothing" : "shared", b, a, 0.94 * cell, 0.94 * cell,
          shared == 0 ? std::string() : fmt::format(" fill-opacity=\"{:.2f}\"", opacity),
          charts::escape_html(calibration.model.cameras[a].id),
          charts::escape_html(calibration.model.cameras[b].id), shared);
    }
  }
  std::string labels;
  for (std::size_t a = 0; a < count && count <= 100; ++a) {
    labels += fmt::format(
        "<text x=\"-0.3\" y=\"{}\" text-anchor=\"end\" style=\"font-size:{}px\">{}</text>",
        static_cast<double>(a) + 0.7, 0.62, charts::escape_html(calibration.model.cameras[a].id));
  }
  return fmt::format(
      "<svg viewBox=\"{0} -1 {1} {2}\" style=\"max-width:{3}px\" role=\"img\" "
      "aria-label=\"Points that pairs of cameras share\">{4}{5}</svg>",
      -0.18 * size - 1.5, 1.18 * size + 2, size + 2, 240 + 12 * count, cells, labels);
}

/// Draws the array from above or from behind.
std::string array_chart(const Calibration& calibration, int up_axis, const char* up_name) {
  double low_x = 0, high_x = 0, low_y = 0, high_y = 0;
  for (const ArrayModel::Camera& camera : calibration.model.cameras) {
    if (!camera.pose) continue;
    const double x = camera.pose->position.x(), y = camera.pose->position[up_axis];
    low_x = std::min(low_x, x), high_x = std::max(high_x, x);
    low_y = std::min(low_y, y), high_y = std::max(high_y, y);
  }
  const double most = std::max({high_x - low_x, high_y - low_y, 1e-6});
  // Equal scale on both axes: a chart is wider than high.
  constexpr double kWider = 3.35, kMargin = 1.2;
  const double middle_x = (low_x + high_x) / 2, middle_y = (low_y + high_y) / 2;
  const double half =
      kMargin / 2 * std::max({(high_x - low_x) / kWider, high_y - low_y, most / 10});
  const char* unit = calibration.scale_is_known ? "m" : "units";
  charts::SvgChart chart(
      "Camera positions",
      {middle_x - kWider * half, middle_x + kWider * half, fmt::format("x, {}", unit), true},
      {middle_y - half, middle_y + half, fmt::format("{}, {}", up_name, unit), true});
  for (const ArrayModel::Camera& camera : calibration.model.cameras) {
    if (!camera.pose) continue;
    const Eigen::Vector3d& at = camera.pose->position;
    const Eigen::Vector3d to = at + 0.08 * most * camera.pose->viewing_direction();
    const std::vector<charts::SvgChart::Point> way{{at.x(), at[up_axis]}, {to.x(), to[up_axis]}};
    chart.line(way, "way");
    chart.dot({at.x(), at[up_axis], "camera", camera.id,
               fmt::format("{}: {:.4f} {:.4f} {:.4f}", camera.id, at.x(), at.y(), at.z()), false});
  }
  return chart.str();
}

/// Returns the table of the cameras with one kind of lens parameters.
std::string deviations_table(const Calibration& calibration, const std::vector<CameraFit>& fits,
                             const LensParameterization& parameterization) {
  const double to_shown = calibration.scale_is_known ? 1000 : 1;
  const auto& parameters = parameterization.parameters();
  std::string rows;
  for (std::size_t i = 0; i < fits.size(); ++i) {
    const ArrayModel::Camera& camera = calibration.model.cameras[i];
    if (&lens_parameterization(camera.intrinsics.projection) != &parameterization) continue;
    rows += fmt::format("<tr><td>{}</td><td>{}</td>", charts::escape_html(camera.id),
                        camera.pose ? "" : "no pose");
    rows += fmt::format("<td>{} / {}</td><td>{:.3f}</td><td>{:.0f} %</td>", fits[i].inliers,
                        fits[i].observations, fits[i].rms_px, 100 * fits[i].image_coverage);
    const auto& deviation = calibration.uncertainty ? calibration.uncertainty->cameras[i]
                                                    : std::optional<Uncertainty::Camera>{};
    if (camera.pose && deviation) {
      const Eigen::Vector3d position = to_shown * deviation->position,
                            turn = deviation->rotation_deg;
      rows += fmt::format("<td>{:.3g} {:.3g} {:.3g}</td><td>{:.2g} {:.2g} {:.2g}</td>",
                          position.x(), position.y(), position.z(), turn.x(), turn.y(), turn.z());
      const LensParameters values = lens_parameters(camera.intrinsics);
      for (std::size_t k = 0; k < values.size(); ++k) {
        if (parameters[k].name.empty()) continue;
        rows += deviation->lens[k] > 0
                    ? fmt::format("<td>{:.5g} ± {:.2g}</td>", values[k], deviation->lens[k])
                    : fmt::format("<td>{:.5g}</td>", values[k]);
      }
    }
    rows += "</tr>";
  }
  if (rows.empty()) return {};
  std::string heading = fmt::format(
      "<tr><th>camera</th><th></th><th>points</th><th>RMS, px</th><th>coverage</th><th>position x "
      "y z, {}</th><th>rotation x y z, degrees</th>",
      calibration.scale_is_known ? "mm" : "units");
  for (const LensParameter& parameter : parameters) {
    if (!parameter.name.empty()) heading += fmt::format("<th>{}</th>", parameter.name);
  }
  return "<div class=\"scroll\"><table>" + heading + "</tr>" + rows + "</table></div>";
}

/// Returns a table for pinholes and one for fisheyes, as far as the array has them.
std::string deviations_tables(const Calibration& calibration, const std::vector<CameraFit>& fits) {
  using schemas::Projection;
  return deviations_table(calibration, fits, lens_parameterization(Projection::kPinhole)) +
         deviations_table(calibration, fits, lens_parameterization(Projection::kFtheta));
}

std::string steps_table(const Calibration& calibration) {
  std::string rows =
      "<tr><th>step</th><th></th><th>RMS, px</th><th>inliers</th><th>outliers</th></tr>";
  for (const SolveReport::Step& step : calibration.solve.steps) {
    rows +=
        fmt::format("<tr><td>{}</td><td></td><td>{:.3f}</td><td>{}</td><td>{}</td></tr>",
                    charts::escape_html(step.what), step.rms_px, step.observations, step.outliers);
  }
  return "<table>" + rows + "</table>";
}

}  // namespace

std::string calibration_report_html(const Calibration& calibration, std::string_view name,
                                    std::string_view lens_models) {
  const std::vector<CameraFit> fits = camera_fits(calibration.model);
  std::string body = verdict_list(calibration.verdict) + facts(calibration);
  body += lens_models;
  body += charts::html_section("The array from behind",
                               "Camera positions; lines show the viewing directions.",
                               array_chart(calibration, 1, "y"));
  body += charts::html_section("The array from above", "The cameras look down, towards smaller z.",
                               array_chart(calibration, 2, "z"));
  body += charts::html_section("Reprojection error of each camera",
                               "RMS distance between observations and projected points.",
                               fit_chart(calibration, fits));
  body += charts::html_section("Points in each camera", "Red: outliers.",
                               points_chart(calibration, fits));
  body += residual_fields(calibration, fits);
  body +=
      charts::html_section("Common points of cameras",
                           "Points that two cameras share: a deeper colour means more; red: none. "
                           "All cameras must be connected.",
                           overlap_chart(calibration));
  body += charts::html_section(
      "Uncertainty",
      "One standard deviation, from the covariance of the last bundle adjustment; "
      "lens values without one were held.",
      deviations_tables(calibration, fits));
  body += charts::html_section("Steps", "The parameters that were refined, in order.",
                               steps_table(calibration));
  return charts::html_page("Calibration", name, body, kStyle);
}

}  // namespace raystage::calibrate
