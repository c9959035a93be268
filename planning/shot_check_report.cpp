// SPDX-License-Identifier: Apache-2.0
#include "planning/shot_check_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string_view>
#include <vector>

#include "base/printable.h"
#include "charts/html_page.h"
#include "charts/svg_chart.h"
#include "compose/frame_range.h"
#include "compose/sequence_memory_plan.h"
#include "rig/plenoptic_sampling.h"
#include "schemas/json_text.h"

namespace raystage::planning {
namespace {

using nlohmann::ordered_json;

constexpr double kPercent = 100;
constexpr double kGhostFree = rig::kMaxAliasFreeDisparity / 2;  // pixels, on each side of the plane

/// Returns a share in percent, with enough digits to tell it from 0.
std::string percent(double share) {
  return share > 0 && share < 1e-4 ? "less than 0.01 %" : fmt::format("{:.2f} %", kPercent * share);
}

std::string frame_count(std::size_t count) {
  return count == 1 ? "1 frame" : fmt::format("{} frames", count);
}

std::string depth_text(double metres) {
  return std::isinf(metres) ? "infinity" : fmt::format("{:.3g} m", metres);
}

/// Returns the frame of a layer in which most rays are missing.
const FrameCheck& worst_frame(const LayerCheck& layer) {
  return *std::ranges::max_element(layer.frames, {}, &FrameCheck::unrecorded_share);
}

std::vector<int> frames_with_missing_rays(const LayerCheck& layer) {
  std::vector<int> frames;
  for (const FrameCheck& frame : layer.frames) {
    if (frame.unrecorded_share > 0) frames.push_back(frame.frame);
  }
  return frames;
}

double narrowed_degrees(double horizontal_fov, double factor) {
  return 2 * std::atan(factor * std::tan(horizontal_fov / 2)) * 180 / std::numbers::pi;
}

std::string without_frames_text(const LayerCheck& layer) {
  std::vector<int> frames;
  for (const FrameCheck& frame : layer.frames) {
    if (frame.cameras == 0) frames.push_back(frame.frame);
  }
  if (frames.empty()) return "";
  return fmt::format("The take has nothing at the time of {}: {}.\n", frame_count(frames.size()),
                     compose::format_frame_range(frames));
}

/// States in how many frames some cameras have no picture.
std::string absent_cameras_text(const LayerCheck& layer) {
  std::vector<int> frames;
  int fewest = layer.cameras;
  for (const FrameCheck& frame : layer.frames) {
    if (frame.cameras == 0 || frame.cameras == layer.cameras) continue;
    frames.push_back(frame.frame);
    fewest = std::min(fewest, frame.cameras);
  }
  if (frames.empty()) return "";
  return fmt::format("Up to {} of {} cameras are absent in {} of {}: {}.\n", layer.cameras - fewest,
                     layer.cameras, frames.size(), frame_count(layer.frames.size()),
                     compose::format_frame_range(frames));
}

std::string coverage_text(const LayerCheck& layer) {
  const std::vector<int> lacking = frames_with_missing_rays(layer);
  if (lacking.empty()) return "Every ray was recorded.\n";
  const FrameCheck& worst = worst_frame(layer);
  std::string text = fmt::format(
      "Up to {} of the rays were recorded by no camera{}, most at frame {}; rays are missing in {} "
      "of {}: "
      "{}.\n",
      percent(worst.unrecorded_share),
      layer.eyes > 1 && !layer.sees_all_directions ? " (of the worse eye)" : "", worst.frame,
      lacking.size(), frame_count(layer.frames.size()), compose::format_frame_range(lacking));
  if (worst.cameras > 0 && worst.cameras < layer.cameras) {
    text += fmt::format("With all cameras {} of those of frame {} would be missing.\n",
                        worst.unrecorded_share_of_all > 0 ? percent(worst.unrecorded_share_of_all)
                                                          : std::string("none"),
                        worst.frame);
  }
  if (layer.field_of_view_factor) {
    text += fmt::format(
        "Every ray was recorded with {:.3f} times the field of view (its tangent), as with {:.1f} "
        "instead of {:.1f} deg at frame {}.\n",
        *layer.field_of_view_factor,
        narrowed_degrees(worst.horizontal_fov, *layer.field_of_view_factor),
        narrowed_degrees(worst.horizontal_fov, 1), worst.frame);
  } else if (!layer.sees_all_directions) {
    text += "No narrower field of view would have all of its rays recorded.\n";
  }
  return text;
}

std::string range_text(const LayerCheck& layer) {
  if (!layer.no_range_because.empty()) {
    return "The range of motion is not known: " + layer.no_range_because + ".\n";
  }
  const FrameCheck* nearest = nullptr;
  std::size_t unknown = 0;
  for (const FrameCheck& frame : layer.frames) {
    if (frame.cameras == 0) continue;
    if (!frame.boundary_distance) {
      ++unknown;
    } else if (nearest == nullptr || *frame.boundary_distance < *nearest->boundary_distance) {
      nearest = &frame;
    }
  }
  if (nearest == nullptr) return "No position of the camera is known to have these views.\n";
  constexpr double kOnBorder = 1e-6;  // metres
  const double distance = *nearest->boundary_distance;
  std::string text;
  if (std::abs(distance) < kOnBorder) {
    text = fmt::format("The camera is on the border of its range of motion at frame {}.\n",
                       nearest->frame);
  } else {
    const std::string_view bound = layer.is_range_exact ? ""
                                   : distance < 0       ? "at most "
                                                        : "at least ";
    text = fmt::format("The camera is {}{:.3f} m {} its range of motion at frame {}.\n", bound,
                       std::abs(distance), distance < 0 ? "outside of" : "within", nearest->frame);
  }
  if (unknown > 0)
    text += fmt::format("In {} the view is from no known position.\n", frame_count(unknown));
  return text;
}

std::string resolution_text(const ShotCheck& check, const LayerCheck& layer) {
  const double worst = layer.worst_resolution();
  if (worst == 0) return "The effective resolution is not known: no camera sees the view.\n";
  return fmt::format(
      "The effective resolution is {:.0f} % of the shot's at least, {:.0f} of {} "
      "pixels.\n",
      kPercent * worst, worst * check.width, check.width);
}

std::string ghosting_text(const LayerCheck& layer) {
  const auto worst = layer.worst_ghosting();
  if (!layer.depth_range) {
    return "Ghosting is not known: the take has no depth range (depth_range in take.json).\n";
  }
  if (!worst) return "Ghosting is not known: the camera does not look at the focal plane.\n";
  std::string text = fmt::format(
      "Ghosting on one focal plane is up to {:.2f} pixels between {} and {} (eq. 2.1).\n", *worst,
      depth_text(layer.depth_range->near), depth_text(layer.depth_range->far));
  if (!layer.uses_focal_plane) {
    return text + "Method " + layer.method + " does not sample rays on one focal plane.\n";
  }
  text += *worst <= kGhostFree ? "One focal plane suffices (focal_plane).\n"
                               : "A method with depths is needed (plane_sweep, depth).\n";
  return text;
}

ordered_json json_of(const std::optional<double>& value) {
  return value && std::isfinite(*value) ? ordered_json(*value) : ordered_json(nullptr);
}

ordered_json json_of(const LayerCheck& layer) {
  ordered_json frames = ordered_json::array();
  for (const FrameCheck& frame : layer.frames) {
    frames.push_back({{"frame", frame.frame},
                      {"has_cameras", frame.cameras > 0},
                      {"cameras", frame.cameras},
                      {"unrecorded_share", frame.unrecorded_share},
                      {"boundary_distance_m", json_of(frame.boundary_distance)},
                      {"resolution", json_of(frame.resolution)},
                      {"near_ghosting_px", json_of(frame.near_ghosting)},
                      {"far_ghosting_px", json_of(frame.far_ghosting)}});
  }
  ordered_json json{
      {"layer", layer.layer},       {"name", layer.name},
      {"method", layer.method},     {"cameras", layer.cameras},
      {"spacing_m", layer.spacing}, {"field_of_view_factor", json_of(layer.field_of_view_factor)}};
  if (!layer.volume.empty()) json["volume"] = layer.volume;
  if (layer.depth_range) {
    json["depth_range_m"] = {layer.depth_range->near, json_of(layer.depth_range->far)};
  }
  json["is_range_exact"] = layer.is_range_exact;
  if (!layer.no_range_because.empty()) json["no_range_because"] = layer.no_range_because;
  json["frames"] = std::move(frames);
  return json;
}

ordered_json json_of(const MeasuredSetting& setting) {
  return {{"label", setting.label},
          {"method", setting.method},
          {"psnr_db", setting.psnr_db},
          {"seconds_per_frame", setting.seconds_per_frame},
          {"peak_memory_bytes", json_of(setting.peak_memory_bytes)}};
}

/// A value over the frames of a layer.
struct Strip {
  std::string_view title, unit, css_class;
  std::vector<charts::SvgChart::Point> points;
};

std::string chart_of(const Strip& strip) {
  double low = 0, high = 0;
  for (const charts::SvgChart::Point& point : strip.points) {
    low = std::min(low, point.y);
    high = std::max(high, point.y);
  }
  if (high == low) high = low + 1;
  const double margin = 0.1 * (high - low);
  const double first = strip.points.front().x, last = strip.points.back().x;
  charts::SvgChart chart(std::string(strip.title), {first, std::max(last, first + 1), "frame"},
                         {low < 0 ? low - margin : low, high + margin, std::string(strip.unit)});
  chart.line(strip.points, strip.css_class);
  if (low < 0) chart.horizontal(0, "border");
  return chart.str();
}

std::string charts_of(const LayerCheck& layer) {
  Strip missing{"Rays that no camera recorded", "percent of the rays", "missing", {}};
  Strip distance{"Distance from the border of the range of motion",
                 "metres, negative: outside",
                 "distance",
                 {}};
  Strip resolution{"Effective resolution", "percent of the shot's", "resolution", {}};
  Strip ghosting{
      "Ghosting on one focal plane", "pixels, the worse end of the scene", "ghosting", {}};
  for (const FrameCheck& frame : layer.frames) {
    const double x = frame.frame;
    missing.points.push_back({x, kPercent * frame.unrecorded_share});
    if (frame.boundary_distance) distance.points.push_back({x, *frame.boundary_distance});
    if (frame.resolution) resolution.points.push_back({x, kPercent * *frame.resolution});
    if (frame.near_ghosting || frame.far_ghosting) {
      ghosting.points.push_back(
          {x, std::max(frame.near_ghosting.value_or(0), frame.far_ghosting.value_or(0))});
    }
  }
  std::string charts;
  for (const Strip* strip : {&missing, &distance, &resolution, &ghosting}) {
    if (strip->points.empty()) continue;
    charts += fmt::format("<h3>{}</h3>\n", strip->title) + chart_of(*strip);
  }
  return charts;
}

std::string lines_as_html(const std::string& text) {
  std::string html;
  for (const char c : charts::escape_html(text)) html += c == '\n' ? "<br>\n" : std::string(1, c);
  return html;
}

std::string seconds_text(double seconds) {
  constexpr double kMinute = 60, kHour = 3600;
  if (seconds < 2 * kMinute) return fmt::format("{:.3g} s", seconds);
  return seconds < 2 * kHour ? fmt::format("{:.0f} min", seconds / kMinute)
                             : fmt::format("{:.1f} h", seconds / kHour);
}

/// States what a bench measured of the layer's method, and what it suggests.
std::string bench_text(const ShotCheck& check, const LayerCheck& layer) {
  const auto& settings = check.measured_settings;
  if (settings.empty()) return "Accuracy and time are not measured (raystage bench).\n";
  std::string text;
  if (const MeasuredSetting* own = setting_of_method(settings, layer.method)) {
    text = fmt::format(
        "Measured with {} at the size of the bench's views: {:.1f} dB, {} a frame, {} for {}{}.\n",
        own->label, own->psnr_db, seconds_text(own->seconds_per_frame),
        seconds_text(own->seconds_per_frame * static_cast<double>(layer.frames.size())),
        frame_count(layer.frames.size()),
        own->peak_memory_bytes
            ? fmt::format(", {:.1f} GB of memory", *own->peak_memory_bytes * 1e-9)
            : "");
  } else {
    text = fmt::format("The bench did not measure method {}.\n", layer.method);
  }
  if (const MeasuredSetting* best = suggested_setting(settings)) {
    text += fmt::format("It suggests {} (method {}): {:.1f} dB, {} a frame.\n", best->label,
                        best->method, best->psnr_db, seconds_text(best->seconds_per_frame));
  }
  return text;
}

/// States for which depths rays and resolution are computed, where the method has its own.
std::string depths_text(const LayerCheck& layer) {
  if (layer.uses_focal_plane) return "";
  return fmt::format(
      "Rays and resolution are those of points on the focal plane that any camera sees; method {} "
      "shows things at their own depths, of which they may see a little more or less at the "
      "borders.\n",
      layer.method);
}

std::string layer_text(const ShotCheck& check, const LayerCheck& layer) {
  if (layer.frames.empty()) return "It is not visible in these frames.\n";
  return without_frames_text(layer) + absent_cameras_text(layer) + coverage_text(layer) +
         range_text(layer) + resolution_text(check, layer) + depths_text(layer) +
         ghosting_text(layer) + bench_text(check, layer);
}

/// States how much memory a frame needs, whatever a bench measured.
std::string memory_text(const ShotCheck& check) {
  return fmt::format(
      "One frame at a time needs {} of memory for its light fields, and what their methods "
      "compute.\n",
      compose::format_byte_size(check.memory));
}

/// States how the camera moves, and what a motion control rig could not do.
std::string motion_text(const ShotCheck& check) {
  const CameraMotion& motion = check.motion;
  const auto shown = [](double value) { return value < kLeastMotion ? 0 : value; };
  std::string text = fmt::format(
      "The camera moves over {:.3g} m, {:.3g} m wide; up to {:.3g} m/s, {:.3g} m/s2 and {:.3g} "
      "deg/s.\n",
      shown(motion.track_length), shown(motion.reach),
      shown(std::max(motion.track_speed.value, motion.extension_speed.value)),
      shown(motion.acceleration.value), shown(motion.turn_speed.value * 180 / std::numbers::pi));
  const std::vector<std::string> exceeded = exceeded_limits(motion, check.motion_limits);
  for (const std::string& sentence : exceeded) text += sentence + "\n";
  if (exceeded.empty() && check.motion_limits.is_limited()) {
    text += "A motion control rig with the given limits could follow it.\n";
  }
  return text;
}

constexpr std::string_view kCheckPageStyle = R"(
polyline.missing { stroke:var(--amber); stroke-width:2 }
polyline.distance, polyline.resolution, polyline.ghosting { stroke:var(--teal); stroke-width:2 }
)";

}  // namespace

std::string shot_check_verdict(const ShotCheck& check) {
  if (!check.has_frames()) return "no light field is visible in these frames";
  const double missing = check.worst_unrecorded_share();
  return fmt::format("{}; effective resolution {:.0f} % of the shot's at least",
                     missing > 0
                         ? fmt::format("up to {} of the rays of a frame were recorded by no camera",
                                       percent(missing))
                         : "every ray was recorded",
                     kPercent * check.worst_resolution());
}

std::string format_shot_check(const ShotCheck& check) {
  std::string text =
      fmt::format("{}: {} ({}), {}x{} pixels\n", printable_in_line(check.shot),
                  frame_count(check.frames.size()), compose::format_frame_range(check.frames),
                  check.width, check.height);
  for (const LayerCheck& layer : check.layers) {
    text += fmt::format("\n{}: method {}, {} cameras up to {:.1f} mm apart\n",
                        printable_in_line(layer.name), layer.method, layer.cameras,
                        1e3 * layer.spacing);
    text += layer_text(check, layer);
  }
  text += "\n" + motion_text(check) + memory_text(check);
  return text + fmt::format("\n{} ({:.3f} s)\n", shot_check_verdict(check), check.seconds);
}

std::string shot_check_as_json(const ShotCheck& check) {
  ordered_json layers = ordered_json::array();
  for (const LayerCheck& layer : check.layers) {
    layers.push_back(json_of(layer));
    const MeasuredSetting* own = setting_of_method(check.measured_settings, layer.method);
    layers.back()["measured"] = own == nullptr ? ordered_json(nullptr) : json_of(*own);
  }
  const MeasuredSetting* suggested = suggested_setting(check.measured_settings);
  const ordered_json json{
      {"schema", "raystage/shot_check/1"},
      {"shot", check.shot},
      {"width", check.width},
      {"height", check.height},
      {"frames", check.frames.size()},
      {"unrecorded_share", check.worst_unrecorded_share()},
      {"resolution", check.worst_resolution()},
      {"motion",
       {{"track_length_m", check.motion.track_length},
        {"reach_m", check.motion.reach},
        {"track_speed_m_per_s", check.motion.track_speed.value},
        {"extension_speed_m_per_s", check.motion.extension_speed.value},
        {"acceleration_m_per_s2", check.motion.acceleration.value},
        {"turn_speed_deg_per_s", check.motion.turn_speed.value * 180 / std::numbers::pi},
        {"exceeded", exceeded_limits(check.motion, check.motion_limits)}}},
      {"memory_bytes", check.memory},
      {"suggested", suggested == nullptr ? ordered_json(nullptr) : json_of(*suggested)},
      {"seconds", check.seconds},
      {"layers", layers}};
  return schemas::dump_json(json) + "\n";
}

std::string shot_check_as_page(const ShotCheck& check) {
  std::string body;
  for (const LayerCheck& layer : check.layers) {
    body +=
        charts::html_section(layer.name, lines_as_html(layer_text(check, layer)), charts_of(layer));
  }
  body += charts::html_section("Motion of the camera", lines_as_html(motion_text(check)), "");
  body += charts::html_section("Memory", lines_as_html(memory_text(check)), "");
  return charts::html_page(
      "Check of the shot: " + check.shot,
      fmt::format("frames {}, {}x{} pixels; {}", compose::format_frame_range(check.frames),
                  check.width, check.height, shot_check_verdict(check)),
      body, kCheckPageStyle);
}

}  // namespace raystage::planning
