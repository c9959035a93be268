// SPDX-License-Identifier: Apache-2.0
#include "planning/resolution_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/error.h"
#include "charts/html_page.h"
#include "charts/svg_chart.h"
#include "schemas/json_text.h"

namespace raystage::planning {
namespace {

using nlohmann::ordered_json;

constexpr double kRadians = std::numbers::pi / 180;
constexpr double kUneven = 1.001;  // ratio of steps from which cameras count as rotated

rig::RowView view_of(const ResolutionOptions& options, double rotation_deg) {
  rig::RowView view;
  view.fov = options.view_fov_deg * kRadians;
  view.rotation = rotation_deg * kRadians;
  view.depth = options.depth_m;
  return view;
}

bool is_uneven(const ResolutionPlan& plan) {
  return plan.sampling.coarsest_step > kUneven * plan.sampling.finest_step;
}

/// Describes the array and its views in sentences.
std::string facts(const ResolutionPlan& plan) {
  const rig::ArraySampling& sampling = plan.sampling;
  std::string text = fmt::format(
      "{} cameras, {} pixels and {:.1f} deg along the {} axis, up to {:.1f} mm apart, {:.3g} m "
      "wide.\n",
      plan.cameras, sampling.pixels, sampling.row.fov / kRadians,
      plan.options.axis == rig::ArrayAxis::kHorizontal ? "horizontal" : "vertical",
      sampling.row.spacing * 1e3, sampling.width);
  if (sampling.is_skewed) {
    text += fmt::format(
        "The cameras are skewed: their frusta coincide {:.3g} m in front of the array. The "
        "resolution depends on the depth of the view.\n",
        sampling.row.fixed_focal_distance);
  }
  if (is_uneven(plan)) {
    text += fmt::format(
        "The cameras are rotated by up to {:.1f} deg and sample a plane parallel to the array "
        "unevenly: an unrotated view has {:.0f} to {:.0f} distinct pixels, depending on where its "
        "rays come from. The table is for unrotated cameras.\n",
        sampling.max_rotation / kRadians, plan.coarsest_pixels, plan.finest_pixels);
  }
  return text;
}

std::string limit_text(const ResolutionPlan& plan) {
  if (plan.sampling.row.spacing <= 0) return "The array has one position.\n";
  const auto depth = [](double metres) {
    return std::isinf(metres) ? std::string("any distance")
                              : fmt::format("{:.2f} m", std::abs(metres));
  };
  return fmt::format(
      "Up to {} in front of the array and {} behind it the pixels of the cameras limit the "
      "resolution, beyond that their spacing.\n",
      depth(plan.depths.in_front), depth(plan.depths.behind));
}

double most_unrecorded(const ResolutionPlan& plan) {
  double most = 0;
  for (const ResolutionPlan::Row& row : plan.rows) {
    most = std::max(most, row.resolution.unrecorded_share);
  }
  return most;
}

/// Returns what a view that the cameras do not cover would need (eq. 6.1).
std::string advice(const ResolutionPlan& plan) {
  if (most_unrecorded(plan) <= 0) return "";
  return fmt::format(
      "Views of {:.4g} deg that turn by {:.4g} deg need cameras of {:.4g} deg; these have {:.1f} "
      "deg.\n",
      plan.options.view_fov_deg, plan.options.max_rotation_deg,
      plan.options.view_fov_deg + 2 * plan.options.max_rotation_deg,
      plan.sampling.row.fov / kRadians);
}

std::string chart_of(const ResolutionPlan& plan) {
  double most = 0, least = plan.rows.front().resolution.never_oversampled;
  std::vector<charts::SvgChart::Point> over, under;
  for (const ResolutionPlan::Row& row : plan.rows) {
    over.push_back({row.rotation_deg, row.resolution.never_oversampled});
    under.push_back({row.rotation_deg, row.resolution.never_undersampled});
    most = std::max(most, row.resolution.never_undersampled);
    least = std::min(least, row.resolution.never_oversampled);
  }
  const double margin = std::max(1.0, 0.15 * (most - least));
  charts::SvgChart chart(
      "Effective resolution against the rotation of the view",
      {0, std::max(1e-3, plan.options.max_rotation_deg), "rotation of the view, degrees"},
      {std::max(0.0, least - margin), most + margin, "pixels"});
  chart.line(over, "over");
  chart.line(under, "under");
  for (const auto& [points, css, name] :
       {std::tuple{&over, "over", "never oversampled"}, {&under, "under", "never undersampled"}}) {
    for (const charts::SvgChart::Point& point : *points) {
      const bool is_last = &point == &points->back();
      chart.dot({point.x, point.y, css, is_last ? name : "",
                 fmt::format("{}: {:.0f} pixels at {:.3g} deg", name, point.y, point.x), is_last});
    }
  }
  return chart.str();
}

std::string table_of(const ResolutionPlan& plan) {
  std::string table =
      "<table><thead><tr><th>rotation, deg</th><th>never oversampled, px</th>"
      "<th>never undersampled, px</th><th>columns not recorded</th></tr></thead><tbody>\n";
  for (const ResolutionPlan::Row& row : plan.rows) {
    table += fmt::format(
        "<tr><td>{:.3g}</td><td>{:.0f}</td><td>{:.0f}</td><td{}>{:.1f} %</td></tr>\n",
        row.rotation_deg, row.resolution.never_oversampled, row.resolution.never_undersampled,
        row.resolution.unrecorded_share > 0 ? " class=\"some\"" : "",
        100 * row.resolution.unrecorded_share);
  }
  return table + "</tbody></table>\n";
}

constexpr std::string_view kPageStyle = R"(
polyline.over { stroke:var(--teal); stroke-width:2 }
polyline.under { stroke:var(--amber); stroke-width:2 }
circle.over { fill:var(--teal) }
circle.under { fill:var(--amber) }
)";

}  // namespace

bool ResolutionOptions::is_valid(std::string* reason) const {
  const auto refuse = [&](const char* why) {
    if (reason != nullptr) *reason = why;
    return false;
  };
  if (!(view_fov_deg >= 0.01 && view_fov_deg <= 179)) {
    return refuse("the field of view must be 0.01 to 179 degrees");
  }
  if (!(max_rotation_deg >= 0 && max_rotation_deg + view_fov_deg / 2 < 90)) {
    return refuse("rotation plus half the field of view must be less than 90 degrees");
  }
  if (!std::isfinite(depth_m)) return refuse("the depth must be finite");
  return true;
}

ResolutionPlan plan_resolution(const std::string& name, const rig::Rig& rig,
                               const ResolutionOptions& options) {
  std::string reason;
  if (!options.is_valid(&reason)) throw Error::bad_input(reason, name, "Correct the view");
  ResolutionPlan plan;
  plan.name = name;
  plan.cameras = static_cast<int>(rig.cameras.size());
  plan.options = options;
  plan.sampling = rig::measure_sampling(rig, options.axis);
  if (plan.sampling.is_skewed && options.depth_m == plan.sampling.row.fixed_focal_distance) {
    throw Error::bad_input("at the fixed focal distance of skewed cameras every view has one pixel",
                           name, "Choose another depth of the view");
  }
  plan.depths = rig::pixel_limited_depths(plan.sampling.row);
  constexpr int kSteps = 6;
  const int steps = options.max_rotation_deg > 0 ? kSteps : 0;
  for (int i = 0; i <= steps; ++i) {
    const double rotation = steps > 0 ? options.max_rotation_deg * i / steps : 0;
    plan.rows.push_back(
        {rotation, rig::effective_resolution(plan.sampling.row, view_of(options, rotation))});
  }
  const double width = 2 * std::tan(options.view_fov_deg * kRadians / 2);
  plan.coarsest_pixels = width / plan.sampling.coarsest_step;
  plan.finest_pixels = width / plan.sampling.finest_step;
  return plan;
}

std::string format_resolution_plan(const ResolutionPlan& plan) {
  std::string text = facts(plan);
  text += fmt::format("\nEffective resolution of views of {:.4g} deg, in pixels:\n",
                      plan.options.view_fov_deg);
  text += "rotation  never oversampled  never undersampled  columns not recorded\n";
  for (const ResolutionPlan::Row& row : plan.rows) {
    text += fmt::format("{:>5.1f} deg {:>18.0f} {:>19.0f} {:>19.1f} %\n", row.rotation_deg,
                        row.resolution.never_oversampled, row.resolution.never_undersampled,
                        100 * row.resolution.unrecorded_share);
  }
  return text + "\n" + limit_text(plan) + advice(plan);
}

std::string resolution_plan_as_json(const ResolutionPlan& plan) {
  const rig::ArraySampling& sampling = plan.sampling;
  ordered_json rows = ordered_json::array();
  for (const ResolutionPlan::Row& row : plan.rows) {
    rows.push_back({{"rotation_deg", row.rotation_deg},
                    {"never_oversampled_px", row.resolution.never_oversampled},
                    {"never_undersampled_px", row.resolution.never_undersampled},
                    {"unrecorded_share", row.resolution.unrecorded_share}});
  }
  const ordered_json json{
      {"schema", "raystage/resolution_plan/1"},
      {"rig", plan.name},
      {"cameras", plan.cameras},
      {"axis", plan.options.axis == rig::ArrayAxis::kHorizontal ? "horizontal" : "vertical"},
      {"camera_pixels", sampling.pixels},
      {"camera_fov_deg", sampling.row.fov / kRadians},
      {"spacing_m", sampling.row.spacing},
      {"width_m", sampling.width},
      {"max_camera_rotation_deg", sampling.max_rotation / kRadians},
      {"fixed_focal_distance_m", schemas::number_or_null(sampling.row.fixed_focal_distance)},
      {"view_fov_deg", plan.options.view_fov_deg},
      {"view_depth_m", plan.options.depth_m},
      {"coarsest_px", plan.coarsest_pixels},
      {"finest_px", plan.finest_pixels},
      {"pixel_limited_in_front_m", schemas::number_or_null(plan.depths.in_front)},
      {"pixel_limited_behind_m", schemas::number_or_null(-plan.depths.behind)},
      {"rotations", rows}};
  return schemas::dump_json(json) + "\n";
}

std::string resolution_plan_as_page(const ResolutionPlan& plan) {
  const std::string explanation =
      charts::escape_html(facts(plan) + limit_text(plan) + advice(plan));
  return charts::html_page("Effective resolution: " + plan.name,
                           fmt::format("views of {:.4g} deg, {:.4g} m in front of the array",
                                       plan.options.view_fov_deg, plan.options.depth_m),
                           charts::html_section("Pixels from distinct samples", explanation,
                                                chart_of(plan) + table_of(plan)),
                           kPageStyle);
}

}  // namespace raystage::planning
