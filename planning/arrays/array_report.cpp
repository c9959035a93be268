// SPDX-License-Identifier: Apache-2.0
#include "planning/arrays/array_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "charts/html_page.h"
#include "charts/svg_chart.h"
#include "schemas/json_text.h"

namespace raystage::planning {
namespace {

using nlohmann::ordered_json;

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr double kMillimetres = 1000;
constexpr double kPercent = 100;

std::string spacing_text(double metres) {
  return std::isinf(metres) ? std::string("any distance")
                            : fmt::format("{:.4g} mm", metres * kMillimetres);
}

/// Describes what the views require, in sentences.
std::string needs_text(const ArrayPlan& plan) {
  const Eigen::Vector2d extent = plan.needed.extent.sizes();
  return fmt::format(
      "The views need cameras of {:.1f} x {:.1f} deg (eq. 6.1) over {:.3f} x {:.3f} m, and {} "
      "apart "
      "at most for {:.3g} px of ghosting on one focal plane (eq. 6.5).\n",
      plan.needed.horizontal_fov * kDegrees, plan.needed.vertical_fov * kDegrees, extent.x(),
      extent.y(), spacing_text(plan.largest_spacing), plan.specification.largest_error_px);
}

std::string array_text(const ArrayAlternative& one) {
  return fmt::format("{}{} x {} {} of {}, {:.1f} deg ({:.4g} mm lens), {:.1f} x {:.1f} mm apart",
                     one.sides == 1 ? "" : fmt::format("{} sides of ", one.sides), one.columns,
                     one.rows, one.is_rotated ? "rotated cameras" : "cameras", one.camera,
                     one.horizontal_fov * kDegrees, one.focal_length_mm,
                     one.spacing.x() * kMillimetres, one.spacing.y() * kMillimetres);
}

/// States the best alternative and what it lacks.
std::string best_text(const ArrayPlan& plan) {
  const ArrayAlternative& best = plan.alternatives[*plan.best];
  std::string text =
      array_text(best) + fmt::format(
                             ": {:.2f} px of ghosting, {:.0f} % of the resolution; {} node{}, {} "
                             "disk{}, {:.0f} MB/s, price "
                             "{:.0f}.\n",
                             best.ghosting_px, kPercent * best.resolution, best.nodes,
                             best.nodes == 1 ? "" : "s", best.disks, best.disks == 1 ? "" : "s",
                             best.megabytes_per_s, best.price);
  if (best.ghosting_px > plan.specification.largest_error_px * (1 + 1e-9)) {
    text +=
        best.is_limited_by_bodies
            ? "The cameras' bodies are too wide for the specified ghosting. A method with depths "
              "(`plane_sweep`, `depth`) allows for more.\n"
            : "No alternative of up to 100,000 cameras has as little ghosting as specified.\n";
  }
  const int wanted = plan.specification.views.width_px;
  if (std::lround(best.resolution * wanted) < wanted) {
    text += fmt::format("The cameras give {:.0f} distinct pixels of the {} that are wanted.\n",
                        best.resolution * wanted, wanted);
  }
  return text;
}

std::string trial_text(const ArrayPlan& plan, const ArrayTrial& trial) {
  return fmt::format(
      "{}: focal_plane {:.1f} dB (predicted {:.1f}), depth {:.1f} dB, simulated with {} x {} "
      "cameras of 320 x 240{}\n",
      array_text(plan.alternatives[trial.alternative]), trial.focal_plane_db, trial.predicted_db,
      trial.depth_db, trial.columns, trial.rows,
      trial.is_extrapolated ? "; extrapolated: the array has more cameras or pixels" : "");
}

/// Returns the alternatives that people should see: the front, and the best one.
std::vector<std::size_t> shown_alternatives(const ArrayPlan& plan) {
  std::vector<std::size_t> shown;
  for (std::size_t i = 0; i < plan.alternatives.size(); ++i) {
    if (plan.alternatives[i].is_on_front || i == plan.best) shown.push_back(i);
  }
  return shown;
}

std::string pareto_chart(const ArrayPlan& plan) {
  double highest_price = 1, lowest_price = INFINITY, most = 0;
  for (const ArrayAlternative& one : plan.alternatives) {
    highest_price = std::max(highest_price, one.price);
    lowest_price = std::min(lowest_price, std::max(1.0, one.price));
    most = std::max(most, one.ghosting_px);
  }
  charts::SvgChart chart("Ghosting of the alternatives against their price",
                         {lowest_price * 0.8, highest_price * 1.25, "price", true, true},
                         {0, std::max(1e-3, 1.1 * most), "ghosting, pixels"});
  chart.horizontal(plan.specification.largest_error_px, "allowed");
  constexpr std::size_t kMostOthers = 300;
  std::size_t others = 0;
  for (std::size_t i = 0; i < plan.alternatives.size(); ++i) {
    const ArrayAlternative& one = plan.alternatives[i];
    const bool is_best = i == plan.best;
    if (!is_best && !one.is_on_front && ++others > kMostOthers) continue;
    charts::SvgChart::Dot dot;
    dot.x = std::max(1.0, one.price);
    dot.y = one.ghosting_px;
    dot.css_class = is_best ? "best" : one.is_on_front ? "front" : "other";
    dot.name = one.is_on_front || is_best ? fmt::format("{} x {}", one.columns, one.rows) : "";
    dot.title =
        fmt::format("{}; {:.2f} px, price {:.0f}", array_text(one), one.ghosting_px, one.price);
    dot.named = is_best;
    chart.dot(dot);
  }
  return chart.str();
}

std::string alternatives_table(const ArrayPlan& plan) {
  std::string table =
      "<table><thead><tr><th>camera</th><th>arrangement</th><th>columns x rows</th><th>spacing, "
      "mm</th><th>field of view, deg</th><th>ghosting, px</th><th>resolution</th><th>MB/s</th>"
      "<th>nodes</th><th>disks</th><th>price</th></tr></thead><tbody>\n";
  for (const std::size_t i : shown_alternatives(plan)) {
    const ArrayAlternative& one = plan.alternatives[i];
    table += fmt::format(
        "<tr{}><td>{}</td><td>{}</td><td>{} x {}</td><td>{:.1f} x {:.1f}</td><td>{:.1f}</td>"
        "<td>{:.2f}</td><td>{:.0f} "
        "%</td><td>{:.0f}</td><td>{}</td><td>{}</td><td>{:.0f}</td></tr>\n",
        i == plan.best ? " class=\"chosen\"" : "", charts::escape_html(one.camera),
        one.is_rotated ? "rotated" : "parallel", one.columns, one.rows,
        one.spacing.x() * kMillimetres, one.spacing.y() * kMillimetres,
        one.horizontal_fov * kDegrees, one.ghosting_px, kPercent * one.resolution,
        one.megabytes_per_s, one.nodes, one.disks, one.price);
  }
  return table + "</tbody></table>\n";
}

std::string trade_table(const ArrayPlan& plan) {
  std::string table =
      "<table><thead><tr><th>columns x rows</th><th>pixels of a camera</th><th>spacing, mm</th>"
      "<th>ghosting, px</th><th>resolution</th></tr></thead><tbody>\n";
  for (const RateTrade& one : plan.trade) {
    table += fmt::format(
        "<tr><td>{} x {}</td><td>{:.0f} x {:.0f}</td><td>{:.1f}</td><td>{:.2f}</td><td>{:.0f} %"
        "</td></tr>\n",
        one.columns, one.rows, one.width_px, one.height_px, one.spacing_m * kMillimetres,
        one.ghosting_px, kPercent * one.resolution);
  }
  return table + "</tbody></table>\n";
}

/// Draws the array and the positions of the views from above.
std::string floor_plan(const ArrayPlan& plan) {
  const ArrayAlternative& best = plan.alternatives[*plan.best];
  const Eigen::Vector2d middle = plan.needed.extent.center();
  const double left = middle.x() - (best.columns - 1) / 2.0 * best.spacing.x();
  double low = left, high = 2 * middle.x() - left, front = 0, back = 0;
  for (const auto& position : plan.specification.positions) {
    low = std::min(low, position.x_m);
    high = std::max(high, position.x_m);
    front = std::max(front, position.depth_m);
    back = std::min(back, position.depth_m);
  }
  const double margin = 0.1 * std::max({high - low, front - back, 0.1});
  charts::SvgChart chart("The array and the positions of the views from above",
                         {low - margin, high + margin, "to the right, metres"},
                         {back - margin, front + margin, "in front of the array, metres"});
  constexpr int kMostDots = 200;  // more cameras than that are drawn as a line
  if (best.columns > kMostDots) {
    const std::vector<charts::SvgChart::Point> row{
        {left, 0}, {left + (best.columns - 1) * best.spacing.x(), 0}};
    chart.line(row, "camera");
  }
  for (int column = 0; column < best.columns && best.columns <= kMostDots; ++column) {
    chart.dot({left + column * best.spacing.x(), 0, "camera", "", "camera"});
  }
  for (const auto& position : plan.specification.positions) {
    chart.dot({position.x_m, position.depth_m, "view", "",
               fmt::format("view at {:.3g}, {:.3g} m, {:.3g} m in front of the array", position.x_m,
                           position.y_m, position.depth_m)});
  }
  return chart.str();
}

constexpr std::string_view kPageStyle = R"(
circle.other { fill:var(--grey) }
circle.front { fill:var(--teal) }
circle.best { fill:var(--amber) }
circle.camera { fill:var(--teal) }
polyline.camera { stroke:var(--teal); stroke-width:3 }
circle.view { fill:var(--amber) }
tr.chosen td { font-weight:600 }
)";

}  // namespace

std::string format_array_plan(const ArrayPlan& plan, const std::vector<ArrayTrial>& trials) {
  std::string text = needs_text(plan) + "Best: " + best_text(plan);
  for (const UnusableCamera& camera : plan.unusable) {
    text += fmt::format("Not usable: {}: {}.\n", camera.camera, camera.because);
  }
  text +=
      "\nAlternatives (no other one has as little ghosting for less):\n"
      "camera                columns x rows  spacing, mm  ghosting, px  resolution    MB/s  nodes  "
      "disks     price\n";
  for (const std::size_t i : shown_alternatives(plan)) {
    const ArrayAlternative& one = plan.alternatives[i];
    text += fmt::format("{:<22}{:>14}{:>13}{:>14.2f}{:>10.0f} %{:>8.0f}{:>7}{:>7}{:>10.0f}{}\n",
                        one.camera + (one.is_rotated ? " (rotated)" : ""),
                        fmt::format("{} x {}", one.columns, one.rows),
                        fmt::format("{:.1f}", one.spacing.maxCoeff() * kMillimetres),
                        one.ghosting_px, kPercent * one.resolution, one.megabytes_per_s, one.nodes,
                        one.disks, one.price, i == plan.best ? "  best" : "");
  }
  text += fmt::format("\nAt {:.4g} megapixels/s (thesis 8.2):\n", plan.trade_megapixels_per_s);
  for (const RateTrade& one : plan.trade) {
    text += fmt::format("{:>12} of {:>11}: {:.2f} px of ghosting, {:.0f} % of the resolution\n",
                        fmt::format("{} x {}", one.columns, one.rows),
                        fmt::format("{:.0f} x {:.0f}", one.width_px, one.height_px),
                        one.ghosting_px, kPercent * one.resolution);
  }
  if (!trials.empty()) text += "\nSimulated:\n";
  for (const ArrayTrial& trial : trials) text += trial_text(plan, trial);
  return text;
}

std::string array_plan_as_json(const ArrayPlan& plan, const std::vector<ArrayTrial>& trials) {
  ordered_json alternatives = ordered_json::array();
  for (std::size_t i = 0; i < plan.alternatives.size(); ++i) {
    const ArrayAlternative& one = plan.alternatives[i];
    alternatives.push_back({{"camera", one.camera},
                            {"focal_length_mm", one.focal_length_mm},
                            {"fov_deg", one.horizontal_fov * kDegrees},
                            {"rotated", one.is_rotated},
                            {"sides", one.sides},
                            {"columns", one.columns},
                            {"rows", one.rows},
                            {"spacing_m", {one.spacing.x(), one.spacing.y()}},
                            {"limited_by_bodies", one.is_limited_by_bodies},
                            {"ghosting_px", one.ghosting_px},
                            {"resolution", one.resolution},
                            {"megapixels_per_s", one.megapixels_per_s},
                            {"megabytes_per_s", one.megabytes_per_s},
                            {"nodes", one.nodes},
                            {"disks", one.disks},
                            {"price", one.price},
                            {"sufficient", one.is_sufficient},
                            {"on_front", one.is_on_front}});
  }
  ordered_json trade = ordered_json::array();
  for (const RateTrade& one : plan.trade) {
    trade.push_back({{"columns", one.columns},
                     {"rows", one.rows},
                     {"width_px", one.width_px},
                     {"height_px", one.height_px},
                     {"spacing_m", one.spacing_m},
                     {"ghosting_px", one.ghosting_px},
                     {"resolution", one.resolution}});
  }
  ordered_json simulated = ordered_json::array();
  for (const ArrayTrial& trial : trials) {
    simulated.push_back({{"alternative", trial.alternative},
                         {"columns", trial.columns},
                         {"rows", trial.rows},
                         {"spacing_m", trial.spacing},
                         {"ghosting_px", trial.ghosting_px},
                         {"predicted_focal_plane_db", trial.predicted_db},
                         {"focal_plane_db", trial.focal_plane_db},
                         {"depth_db", trial.depth_db},
                         {"extrapolated", trial.is_extrapolated}});
  }
  ordered_json unusable = ordered_json::array();
  for (const UnusableCamera& camera : plan.unusable) {
    unusable.push_back({{"camera", camera.camera}, {"because", camera.because}});
  }
  const Eigen::Vector2d extent = plan.needed.extent.sizes();
  const ordered_json json{
      {"schema", "raystage/array_plan/1"},
      {"name", plan.specification.name},
      {"needed_fov_deg",
       {plan.needed.horizontal_fov * kDegrees, plan.needed.vertical_fov * kDegrees}},
      {"needed_extent_m", {extent.x(), extent.y()}},
      {"largest_spacing_m", schemas::number_or_null(plan.largest_spacing)},
      {"best", *plan.best},
      {"alternatives", alternatives},
      {"unusable", unusable},
      {"trade_megapixels_per_s", plan.trade_megapixels_per_s},
      {"trade", trade},
      {"simulated", simulated}};
  return schemas::dump_json(json) + "\n";
}

std::string array_plan_as_page(const ArrayPlan& plan, const std::vector<ArrayTrial>& trials) {
  std::string body = charts::html_section(
      "Ghosting against price",
      charts::escape_html(needs_text(plan) + best_text(plan)) +
          " Amber: that array. Teal: no other one has as little ghosting for less. Grey: the "
          "others, and those with less resolution.",
      pareto_chart(plan) + alternatives_table(plan));
  if (!trials.empty()) {
    std::string rows;
    for (const ArrayTrial& trial : trials) {
      rows += "<p>" + charts::escape_html(trial_text(plan, trial)) + "</p>\n";
    }
    body += charts::html_section(
        "Simulated", "Measured in the simulator's static stage, at equal disparity in pixels.",
        rows);
  }
  body += charts::html_section("The array from above", "Teal: cameras, amber: positions of views.",
                               floor_plan(plan));
  body += charts::html_section(
      "Number of cameras against their resolution",
      fmt::format("All of these record {:.4g} megapixels a second (thesis 8.2).",
                  plan.trade_megapixels_per_s),
      trade_table(plan));
  return charts::html_page("Camera array: " + plan.specification.name,
                           array_text(plan.alternatives[*plan.best]), body, kPageStyle);
}

}  // namespace raystage::planning
