// SPDX-License-Identifier: Apache-2.0
#include "planning/coverage_report.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <string_view>
#include <vector>

#include "base/printable.h"
#include "charts/html_page.h"
#include "rig/planning/wall_eyed_array.h"
#include "schemas/json_text.h"

namespace raystage::planning {
namespace {

using nlohmann::ordered_json;

constexpr double kMillimetres = 1000;

ordered_json json_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

std::string views_text(const CoveragePlan& plan) {
  const CoverageOptions& options = plan.options;
  const std::string rays =
      std::isinf(options.focal_depth_m) ? std::string("; rays as far as the horizon.")
      : plan.looks_around
          ? fmt::format("; rays to a focal surface {:.4g} m from the array's middle.",
                        options.focal_depth_m)
          : fmt::format("; rays to a focal plane {:.4g} m in front of the array.",
                        options.focal_depth_m);
  if (options.all_directions) return "Views of all directions" + rays;
  std::string text = fmt::format("Views of width / height {:.3g}", options.aspect);
  if (options.yaw_deg != 0 || options.pitch_deg != 0) {
    text += fmt::format(", turned by {:.4g} deg to the left and {:.4g} deg upwards",
                        options.yaw_deg, options.pitch_deg);
  }
  if (options.max_yaw_deg > 0) {
    text += fmt::format(", that turn by up to {:.4g} deg to both sides", options.max_yaw_deg);
  }
  if (options.interaxial_m > 0) {
    text += fmt::format(", for two eyes {:.1f} mm apart", kMillimetres * options.interaxial_m);
  }
  return text + rays;
}

std::string size_text(const CoverageVolume& volume, bool looks_around) {
  if (volume.surface.vertices.empty()) return volume.empty_because;
  const Eigen::Vector3d extent = volume.extent();
  std::string text =
      fmt::format("{:.3f} x {:.3f} x {:.3f} m, {:.5f} m3{}", extent.x(), extent.y(), extent.z(),
                  volume.surface.volume(),
                  volume.is_in_parts ? " (one part: there are positions apart from it)" : "");
  if (volume.cut_off_m) {
    text += fmt::format(", cut off {:.3f} m {} the array, where it goes on", *volume.cut_off_m,
                        looks_around ? "from the middle of" : "behind");
  }
  return text;
}

std::string accuracy_text(const CoverageVolume& volume, const CoverageOptions& options) {
  if (volume.surface.vertices.empty()) return "";
  if (volume.error_m > options.tolerance_m * (1 + 1e-9)) {
    return fmt::format("{}within {:.1f} mm, as far as {} vertices can be",
                       volume.is_lower_bound ? "at least, " : "", kMillimetres * volume.error_m,
                       volume.surface.vertices.size());
  }
  if (volume.is_lower_bound) {
    return volume.error_m > 0
               ? fmt::format("at least, within {:.1f} mm", kMillimetres * volume.error_m)
               : std::string("at least");
  }
  return volume.is_exact ? "exact" : fmt::format("within {:.1f} mm", kMillimetres * volume.error_m);
}

/// Describes several arrays, a line each, and from where they see the subject.
std::string arrays_text(const CoveragePlan& plan) {
  std::string text;
  if (plan.looks_around) {
    const Eigen::Vector3d ahead =
        Eigen::Vector3d::Zero() - plan.array.world_from_camera_rotation.col(2);  // no -0
    text += fmt::format(
        "The cameras look around. Positions and views are relative to their middle; views that do "
        "not turn look along ({:.3f}, {:.3f}, {:.3f}) of the world.\n",
        ahead.x(), ahead.y(), ahead.z());
  }
  for (const CoverageArray& array : plan.arrays) {
    text += fmt::format("{}: {} cameras, {:.3f} x {:.3f} m, {:.1f} x {:.1f} deg{}\n",
                        printable_in_line(array.name), array.cameras, array.size_m.x(),
                        array.size_m.y(), array.fov_deg.x(), array.fov_deg.y(),
                        array.is_ideal ? "" : " (at least)");
  }
  if (plan.arrays.size() > 1) {
    text += plan.options.arrays_hide_each_other
                ? "Rays that pass through another array do not count.\n"
                : "The arrays do not hide anything from each other.\n";
  }
  if (plan.subject_view) {
    text += fmt::format(
        "The middle of the subject is seen from {:.3g} % of all directions, by {} "
        "array{}.\n",
        100 * plan.subject_view->share_of_directions, plan.subject_view->arrays,
        plan.subject_view->arrays == 1 ? "" : "s");
  }
  return text;
}

/// Returns the lines of a text as paragraphs.
std::string paragraphs(std::string_view text) {
  std::string html;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    html += fmt::format("<p class=\"arrays\">{}</p>\n", charts::escape_html(text.substr(0, end)));
    text.remove_prefix(std::min(text.size(), end + 1));
  }
  return html;
}

/// Describes the views of a volume.
std::string fov_text(const CoverageVolume& volume, bool all_directions) {
  if (volume.is_of_subject) return "of the subject";
  return all_directions ? "all directions" : fmt::format("{:.4g} deg", volume.view_fov_deg);
}

/// A drawing in metres with equal scales.
class Drawing {
 public:
  using Project = std::function<Eigen::Vector2d(const Eigen::Vector3d&)>;

  Drawing(std::string_view title, Project project) : title_(title), project_(std::move(project)) {}

  void add(const CoverageVolume& volume, std::size_t color) {
    std::vector<Eigen::Vector2d> points;
    for (const Eigen::Vector3d& vertex : volume.surface.vertices)
      points.push_back(project_(vertex));
    if (points.empty()) return;
    for (const Eigen::Vector2d& point : points) box_.extend(point);
    outlines_.push_back(
        {rig::convex_hull(std::move(points), 0), color, volume.share == 1, name_of(volume)});
  }
  void add_camera(const Eigen::Vector3d& centre) {
    cameras_.push_back(project_(centre));
    box_.extend(cameras_.back());
  }

  std::string str() const {
    if (box_.isEmpty()) return "";
    constexpr double kWidth = 500, kHeight = 360, kMargin = 30;
    const Eigen::Vector2d size = box_.diagonal().cwiseMax(1e-6);
    const double scale =
        std::min((kWidth - 2 * kMargin) / size.x(), (kHeight - 2 * kMargin) / size.y());
    const Eigen::Vector2d middle = box_.center();
    const auto at = [&](const Eigen::Vector2d& p) {
      return fmt::format("{:.2f},{:.2f}", kWidth / 2 + scale * (p.x() - middle.x()),
                         kHeight / 2 - scale * (p.y() - middle.y()));
    };
    std::string svg =
        fmt::format("<figure><svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">", kWidth,
                    kHeight, title_);
    for (const Outline& outline : outlines_) {
      std::string points;
      for (const Eigen::Vector2d& corner : outline.corners) points += at(corner) + " ";
      svg += fmt::format(
          "<polygon class=\"volume fov{} {}\" points=\"{}\"><title>{}</title>"
          "</polygon>",
          outline.color % 4, outline.is_whole ? "whole" : "part", points, outline.name);
    }
    for (const Eigen::Vector2d& camera : cameras_) {
      const std::string place = at(camera);
      const auto comma = place.find(',');
      svg += fmt::format("<circle class=\"camera\" cx=\"{}\" cy=\"{}\" r=\"1.6\"/>",
                         place.substr(0, comma), place.substr(comma + 1));
    }
    // A bar of one, two or five times a power of ten, about a quarter of the width.
    const double wanted = kWidth / 4 / scale, power = std::pow(10, std::floor(std::log10(wanted)));
    const double bar = wanted >= 5 * power ? 5 * power : wanted >= 2 * power ? 2 * power : power;
    svg += fmt::format(
        "<path class=\"scale\" d=\"M{} {} h{:.2f}\"/><text x=\"{}\" y=\"{}\">{:.3g} "
        "m</text>",
        kMargin, kHeight - 10, bar * scale, kMargin, kHeight - 15, bar);
    return svg + fmt::format("</svg><figcaption>{}</figcaption></figure>\n", title_);
  }

 private:
  struct Outline {
    std::vector<Eigen::Vector2d> corners;
    std::size_t color;
    bool is_whole;
    std::string name;
  };
  std::string title_;
  Project project_;
  Eigen::AlignedBox2d box_;
  std::vector<Outline> outlines_;
  std::vector<Eigen::Vector2d> cameras_;
};

std::string drawings_of(const CoveragePlan& plan) {
  // Seen from the front, left and above.
  const Eigen::Vector3d right = Eigen::Vector3d(0.8, 0, 0.6).normalized(),
                        away = Eigen::Vector3d(-0.5, -0.35, 0.67).normalized(),
                        up = away.cross(right).normalized() * -1;
  std::vector<Drawing> drawings;
  const bool around = plan.looks_around;
  drawings.emplace_back(around ? "Plan: views look up" : "Plan: the array looks up",
                        [](const Eigen::Vector3d& p) { return Eigen::Vector2d(p.x(), -p.z()); });
  drawings.emplace_back(
      around ? "Elevation: views look to the left" : "Elevation: the array looks to the left",
      [](const Eigen::Vector3d& p) { return Eigen::Vector2d(p.z(), p.y()); });
  drawings.emplace_back(around ? "From behind" : "From behind the array",
                        [](const Eigen::Vector3d& p) { return Eigen::Vector2d(p.x(), p.y()); });
  drawings.emplace_back("Seen from the left and above", [right, up](const Eigen::Vector3d& p) {
    return Eigen::Vector2d(p.dot(right), p.dot(up));
  });
  std::string html = "<div class=\"drawings\">\n";
  for (Drawing& drawing : drawings) {
    std::size_t color = 0;
    double last_fov = plan.volumes.empty() ? 0 : plan.volumes.front().view_fov_deg;
    for (const CoverageVolume& volume : plan.volumes) {
      if (volume.view_fov_deg != last_fov) ++color;
      last_fov = volume.view_fov_deg;
      drawing.add(volume, color);
    }
    for (const Eigen::Vector3d& camera : plan.cameras) drawing.add_camera(camera);
    html += drawing.str();
  }
  return html + "</div>\n";
}

std::string table_of(const CoveragePlan& plan) {
  std::size_t color = 0;
  double last_fov = plan.volumes.empty() ? 0 : plan.volumes.front().view_fov_deg;
  std::string table =
      "<table><thead><tr><th>field of view</th><th>rays recorded</th><th>width x height x "
      "depth, volume</th><th>accuracy</th></tr></thead><tbody>\n";
  for (const CoverageVolume& volume : plan.volumes) {
    if (volume.view_fov_deg != last_fov) ++color;
    last_fov = volume.view_fov_deg;
    table += fmt::format(
        "<tr><td><svg class=\"key\" viewBox=\"0 0 24 12\"><rect class=\"volume fov{} {}\" x=\"1\" "
        "y=\"1\" width=\"22\" height=\"10\"/></svg>{}</td><td>{}</td>"
        "<td>{}</td><td>{}</td></tr>\n",
        color % 4, volume.share == 1 ? "whole" : "part",
        fov_text(volume, plan.options.all_directions), fmt::format("{:.4g} %", 100 * volume.share),
        charts::escape_html(size_text(volume, plan.looks_around)),
        accuracy_text(volume, plan.options));
  }
  return table + "</tbody></table>\n";
}

constexpr std::string_view kCoveragePageStyle = R"(
.drawings { display:grid; grid-template-columns:repeat(auto-fit, minmax(380px, 1fr)); gap:12px }
.arrays { margin:2px 0 }
.drawings figure { margin:0 }
.volume { fill-opacity:.15; stroke-width:1.5 }
.volume.part { fill-opacity:.05; stroke-dasharray:4 3 }
.fov0 { fill:var(--teal); stroke:var(--teal) }
.fov1 { fill:var(--amber); stroke:var(--amber) }
.fov2 { fill:#7a5fd0; stroke:#7a5fd0 }
.fov3 { fill:#c04060; stroke:#c04060 }
.key { width:24px; height:12px; margin-right:8px }
.camera { fill:currentColor }
.scale { stroke:currentColor; stroke-width:2; fill:none }
)";

}  // namespace

std::string name_of(const CoverageVolume& volume) {
  if (volume.is_of_subject) return "subject";
  if (volume.view_fov_deg == 360)
    return fmt::format("all directions, {:.4g} %", 100 * volume.share);
  return fmt::format("{:.4g} deg, {:.4g} %", volume.view_fov_deg, 100 * volume.share);
}

std::string format_coverage_plan(const CoveragePlan& plan) {
  std::string text =
      fmt::format("{}: {} camera{}\n{}\n{}\n", printable_in_line(plan.name), plan.cameras.size(),
                  plan.cameras.size() == 1 ? "" : "s", views_text(plan), arrays_text(plan));
  text += "field of view     rays  range of motion: width x height x depth, volume\n";
  for (const CoverageVolume& volume : plan.volumes) {
    const std::string views = fov_text(volume, plan.options.all_directions);
    text += volume.is_of_subject ? fmt::format("{:>22}  ", views)
                                 : fmt::format("{:>13} {:>6.4g} %  ", views, 100 * volume.share);
    text += fmt::format("{}{}{}\n", size_text(volume, plan.looks_around),
                        volume.surface.vertices.empty() ? "" : ", ",
                        accuracy_text(volume, plan.options));
  }
  return text;
}

std::string coverage_plan_as_json(const CoveragePlan& plan) {
  const CoverageOptions& options = plan.options;
  ordered_json volumes = ordered_json::array();
  for (const CoverageVolume& volume : plan.volumes) {
    ordered_json vertices = ordered_json::array();
    for (const Eigen::Vector3d& vertex : volume.surface.vertices) {
      vertices.push_back(json_of(plan.array.world_from_camera(vertex)));
    }
    ordered_json json{
        {"view_fov_deg", volume.view_fov_deg},  {"share", volume.share},
        {"is_exact", volume.is_exact},          {"error_m", volume.error_m},
        {"volume_m3", volume.surface.volume()}, {"extent_m", json_of(volume.extent())}};
    json["of_subject"] = volume.is_of_subject;
    json["is_lower_bound"] = volume.is_lower_bound;
    json["is_in_parts"] = volume.is_in_parts;
    json["cut_off_m"] = volume.cut_off_m ? ordered_json(*volume.cut_off_m) : ordered_json(nullptr);
    if (!volume.empty_because.empty()) json["empty_because"] = volume.empty_because;
    json["vertices_m"] = std::move(vertices);
    json["triangles"] = volume.surface.triangles;
    volumes.push_back(std::move(json));
  }
  ordered_json json{
      {"schema", "raystage/coverage_plan/1"},
      {"rig", plan.name},
      {"cameras", plan.cameras.size()},
      {"aspect", options.aspect},
      {"yaw_deg", options.yaw_deg},
      {"pitch_deg", options.pitch_deg},
      {"max_yaw_deg", options.max_yaw_deg},
      {"interaxial_m", options.interaxial_m},
      {"focal_depth_m", std::isfinite(options.focal_depth_m) ? ordered_json(options.focal_depth_m)
                                                             : ordered_json(nullptr)},
      {"all_directions", options.all_directions},
      {"volumes", volumes}};
  if (plan.looks_around) {
    const rig::Pose& pose = plan.array;
    json["looks_around"] = {{"middle_m", json_of(pose.position)},
                            {"ahead", json_of(-pose.world_from_camera_rotation.col(2))},
                            {"up", json_of(pose.world_from_camera_rotation.col(1))}};
  }
  if (!plan.arrays.empty()) {
    json["arrays_hide_each_other"] = options.arrays_hide_each_other;
    for (const CoverageArray& array : plan.arrays) {
      json["arrays"].push_back({{"name", array.name},
                                {"cameras", array.cameras},
                                {"is_ideal", array.is_ideal},
                                {"size_m", {array.size_m.x(), array.size_m.y()}},
                                {"fov_deg", {array.fov_deg.x(), array.fov_deg.y()}}});
    }
  }
  if (plan.subject_view) {
    json["subject"] = {{"share_of_directions", plan.subject_view->share_of_directions},
                       {"arrays", plan.subject_view->arrays}};
  }
  return schemas::dump_json(json, 1) + "\n";
}

std::string coverage_plan_as_page(const CoveragePlan& plan) {
  return charts::html_page(
      "Range of motion: " + plan.name, fmt::format("{} cameras", plan.cameras.size()),
      charts::html_section("Where the virtual camera may stand",
                           charts::escape_html(views_text(plan)),
                           paragraphs(arrays_text(plan)) + drawings_of(plan) + table_of(plan)),
      kCoveragePageStyle);
}

}  // namespace raystage::planning
