// SPDX-License-Identifier: Apache-2.0
// Formats calibrated lenses as a self-contained HTML page.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "calibrate/geometry/model_selection.h"
#include "calibrate/lens_report.h"
#include "charts/html_page.h"
#include "charts/svg_chart.h"
#include "rig/camera_model.h"
#include "schemas/projection_names.h"

namespace raystage::calibrate {
namespace {

constexpr std::string_view kLensPageStyle = R"(
.verdict { margin:0 0 40px; padding:0; list-style:none; max-width:100ch }
.verdict li { padding:5px 0 5px 18px; border-left:2px solid var(--rule) }
.verdict li:first-child { font-size:19px; border-color:var(--amber) }
svg .fit { fill:var(--teal) }
svg .rejected { fill:var(--red) }
svg .curve { fill:none; stroke:var(--teal); stroke-width:1.2 }
.scroll { overflow-x:auto }
td, th { text-align:left; padding:2px 14px 2px 0; white-space:nowrap }
)";

std::string lens_verdict(std::span<const CameraLens> lenses) {
  const auto rejected = std::ranges::count_if(
      lenses, [](const CameraLens& lens) { return !lens.calibration.reasons.empty(); });
  std::string items = fmt::format(
      "<li>{}</li>", rejected == 0
                         ? std::string("All lenses are accepted.")
                         : fmt::format("{} of {} lenses are rejected.", rejected, lenses.size()));
  for (const CameraLens& lens : lenses) {
    const auto add = [&](const char* lead, const std::vector<std::string>& sentences) {
      for (const std::string& sentence : sentences) {
        items += fmt::format("<li>{}: {}{}</li>", charts::escape_html(lens.id), lead,
                             charts::escape_html(sentence));
      }
    };
    add("", lens.calibration.reasons);
    add("Next: ", lens.calibration.next_steps);
  }
  return "<ul class=\"verdict\">" + items + "</ul>";
}

/// Draws a value of each camera as a bar; values that are not finite have none.
template <class Value>
std::string camera_bars(std::span<const CameraLens> lenses, const char* description,
                        const char* axis, double least, const Value& value) {
  double most = least;
  for (const CameraLens& lens : lenses) {
    if (std::isfinite(value(lens))) most = std::max(most, value(lens));
  }
  const auto count = static_cast<double>(lenses.size());
  charts::SvgChart chart(description, {-0.5, count - 0.5, "", false}, {0, 1.15 * most, axis, true});
  for (std::size_t i = 0; i < lenses.size(); ++i) {
    const auto x = static_cast<double>(i);
    if (std::isfinite(value(lenses[i]))) {
      chart.bar(x - 0.4, x + 0.4, 0, value(lenses[i]),
                lenses[i].calibration.reasons.empty() ? "fit" : "rejected",
                fmt::format("{}: {:.3g} {}", lenses[i].id, value(lenses[i]), axis));
    }
    chart.x_label(x, lenses[i].id, lenses.size() > 12);
  }
  return chart.str();
}

/// Draws how far from the principal point each lens shows a ray, by its angle to the axis.
std::string projection_chart(std::span<const CameraLens> lenses) {
  struct Curve {
    std::vector<charts::SvgChart::Point> points;
  };
  std::vector<Curve> curves;
  double widest = 1, farthest = 1;
  for (const CameraLens& lens : lenses) {
    const schemas::Intrinsics& k = lens.calibration.lens;
    const rig::CameraModel model({lens.id, lens.width, lens.height, k, {}, {}, {}});
    const double corner =
        std::hypot(std::max(k.cx, lens.width - k.cx), std::max(k.cy, lens.height - k.cy));
    Curve curve;
    constexpr int kDegrees = 180;
    for (int degrees = 0; degrees <= kDegrees; ++degrees) {
      const double angle = degrees * std::numbers::pi / 180;
      const auto pixel = model.project({std::sin(angle), 0, -std::cos(angle)});
      if (!pixel) break;
      const double distance = std::hypot(pixel->x() - k.cx, pixel->y() - k.cy);
      if (!(distance <= corner)) break;
      curve.points.push_back({static_cast<double>(degrees), distance});
      widest = std::max(widest, static_cast<double>(degrees));
      farthest = std::max(farthest, distance);
    }
    curves.push_back(std::move(curve));
  }
  charts::SvgChart chart("Distance from the principal point by angle",
                         {0, widest, "angle to the axis, degrees", true},
                         {0, 1.05 * farthest, "distance, px", true});
  for (const Curve& curve : curves) chart.line(curve.points, "curve");
  return chart.str();
}

std::string lens_table(std::span<const CameraLens> lenses) {
  std::string rows;
  for (const CameraLens& lens : lenses) {
    const LensCalibration& found = lens.calibration;
    std::string parameters;
    const LensParameters values = lens_parameters(found.lens);
    const auto& names = lens_parameterization(found.lens.projection).parameters();
    for (std::size_t k = 0; k < values.size(); ++k) {
      if (found.deviations[k] == 0 && values[k] == 0) continue;
      parameters += fmt::format("{}{} {:.5g} &plusmn; {:.2g}", parameters.empty() ? "" : ", ",
                                names[k].name, values[k], found.deviations[k]);
    }
    rows += fmt::format(
        "<tr><td>{}</td><td>{}</td><td>{:.3f}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.0f} "
        "%</td><td>{:.0f}</td><td>{}</td></tr>\n",
        charts::escape_html(lens.id), schemas::name_of(found.lens.projection), found.rms_px,
        found.views, found.corners, found.outliers, 100 * found.image_coverage, found.max_tilt_deg,
        parameters);
  }
  return "<div class=\"scroll\"><table><thead><tr><th>camera</th><th>model</th><th>RMS, px</th>"
         "<th>frames</th><th>corners</th><th>outliers</th><th>picture covered</th><th>largest "
         "tilt, deg</th><th>parameters, one standard deviation</th></tr></thead><tbody>\n" +
         rows + "</tbody></table></div>\n";
}

std::string models_section(std::span<const CameraLens> lenses) {
  std::string rows;
  for (const CameraLens& lens : lenses) {
    if (!lens.comparison) continue;
    for (std::size_t k = 0; k < lens.comparison->fits.size(); ++k) {
      const LensModelFit& fit = lens.comparison->fits[k];
      const std::string result =
          fit.failure.empty()
              ? fmt::format("<td>{:.3f}</td><td>{:.3f}</td><td>{:+.0f}</td><td>{}</td>",
                            fit.held_out_rms_px, fit.rms_px,
                            fit.bic - lens.comparison->best_fit().bic,
                            model_rank(k == lens.comparison->best, fit.is_worse))
              : fmt::format("<td></td><td></td><td></td><td>does not fit: {}</td>",
                            charts::escape_html(fit.failure));
      rows += fmt::format("<tr><td>{}</td><td>{}</td>{}</tr>\n", charts::escape_html(lens.id),
                          compared_model_name(fit.projection), result);
    }
  }
  if (rows.empty()) return "";
  return charts::html_section(
      "Lens models",
      "The best model has the least error on boards that were held out; of models that these do "
      "not distinguish, the pinhole or the one with the least distortion is used.",
      "<div class=\"scroll\"><table><thead><tr><th>camera</th><th>model</th><th>held out, px "
      "RMS</th><th>all, px RMS</th><th>BIC, difference</th><th></th></tr></thead><tbody>\n" +
          rows + "</tbody></table></div>\n");
}

}  // namespace

std::string lens_report_html(std::span<const CameraLens> lenses, const std::string& file) {
  const std::string errors =
      camera_bars(lenses, "RMS reprojection error of each camera", "px", 0.1,
                  [](const CameraLens& lens) { return lens.calibration.rms_px; });
  const std::string coverage = camera_bars(
      lenses, "Share of the picture with corners, of each camera", "% of the picture", 100 / 1.15,
      [](const CameraLens& lens) { return 100 * lens.calibration.image_coverage; });
  return charts::html_page(
      "Lens calibration", file,
      lens_verdict(lenses) +
          charts::html_section("Reprojection error", "Of the inliers, RMS; red: rejected.",
                               errors) +
          charts::html_section("Picture covered",
                               "Share of the cells of a 4x4 grid that have a corner. Distortion is "
                               "not known where no corner was seen.",
                               coverage) +
          charts::html_section("Projection",
                               "Distance from the principal point at which a ray is seen, by its "
                               "angle to the axis, up to the corner of the picture; one line per "
                               "camera.",
                               projection_chart(lenses)) +
          models_section(lenses) + charts::html_section("Lenses", "", lens_table(lenses)),
      kLensPageStyle);
}

}  // namespace raystage::calibrate
