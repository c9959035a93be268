// SPDX-License-Identifier: Apache-2.0
#include "simulate/truth_document.h"

#include <nlohmann/json.hpp>

namespace raystage::simulate {
namespace {

using nlohmann::ordered_json;

ordered_json settings_json(const SimulationOptions& s) {
  return {{"scene", s.scene},
          {"rows", s.rows},
          {"columns", s.columns},
          {"position_m", s.position},
          {"turn_deg", s.turn_deg},
          {"spacing_m", s.spacing},
          {"horizontal_fov_deg", s.horizontal_fov_deg},
          {"width", s.width},
          {"height", s.height},
          {"lens", schemas::name_of(s.lens)},
          {"has_given_rig", s.given_rig.has_value()},
          {"lens", schemas::name_of(s.lens)},
          {"has_given_rig", s.given_rig.has_value()},
          {"k1", s.k1},
          {"k2", s.k2},
          {"lens_deviation", s.lens_deviation},
          {"mounting_error_m", s.mounting_error},
          {"mounting_error_deg", s.mounting_error_deg},
          {"photometric_deviation", s.photometric_deviation},
          {"gain", s.color_errors.gain},
          {"white_balance", s.color_errors.white_balance},
          {"offset", s.color_errors.offset},
          {"vignetting", s.color_errors.vignetting},
          {"color_mix", s.color_errors.crosstalk},
          {"curve", s.color_errors.curve},
          {"hot_pixels", s.color_errors.hot_pixels},
          {"calibration", s.nominal_calibration ? "nominal" : "true"},
          {"fps", s.fps},
          {"seconds", s.seconds},
          {"period_error_ppm", s.period_error_ppm},
          {"jitter_s", s.jitter},
          {"clock_offset_s", s.clock_offset},
          {"cameras_per_node", s.cameras_per_node},
          {"start_up_loss_s", s.startup_loss_s},
          {"drop_probability", s.drop_probability},
          {"line_time_us", s.line_time_us ? ordered_json(*s.line_time_us) : ordered_json()},
          {"hdr", s.hdr},
          {"bits", s.records_half ? 16 : 8},
          {"noise", s.noise},
          {"edge_samples", s.edge_samples},
          {"truth_samples", s.truth_samples},
          {"truth_shutter_deg", s.truth_shutter_deg},
          {"truth_spheres_m", s.truth_spheres},
          {"jpeg_quality", s.jpeg.quality}};
}

ordered_json times_json(const ExposureSchedule::Camera& camera, const std::string& id) {
  ordered_json true_times = ordered_json::array(), stamps = ordered_json::array();
  ordered_json status = ordered_json::array();
  for (const ExposureSchedule::Frame& frame : camera.frames) {
    true_times.push_back(frame.true_time);
    stamps.push_back(frame.stamped_time);
    status.push_back(store::name_of(frame.status));
  }
  return {{"id", id},
          {"node", "node" + std::to_string(camera.node)},
          {"phase_ns", camera.phase},
          {"period_ns", camera.period_ns},
          {"true_time_ns", std::move(true_times)},
          {"stamped_time_ns", std::move(stamps)},
          {"status", std::move(status)}};
}

// Returns a JSON array property with one element per line.
std::string lines(const char* key, const std::vector<ordered_json>& elements) {
  std::string text = std::string("  \"") + key + "\": [\n";
  for (std::size_t i = 0; i < elements.size(); ++i) {
    text += "    " + elements[i].dump() + (i + 1 < elements.size() ? ",\n" : "\n");
  }
  return text + "  ]";
}

}  // namespace

std::string format_truth_document(const SimulationOptions& options, const SimulatedRig& array,
                                  const ExposureSchedule& schedule) {
  std::vector<ordered_json> nodes, cameras;
  for (std::size_t i = 0; i < schedule.clock_offset.size(); ++i) {
    nodes.push_back(
        {{"id", "node" + std::to_string(i)}, {"clock_offset_ns", schedule.clock_offset[i]}});
  }
  for (std::size_t i = 0; i < schedule.cameras.size(); ++i) {
    cameras.push_back(times_json(schedule.cameras[i], array.truth.cameras[i].geometry.id));
  }
  const auto rig = [](const schemas::RigDocument& document) {
    return ordered_json::parse(schemas::format_rig(document)).dump();
  };
  std::string text = "{\n  \"schema\": \"raystage/simulation-truth/1\",\n";
  text += "  \"seed\": " + std::to_string(options.seed) + ",\n";
  text += "  \"settings\": " + settings_json(options).dump() + ",\n";
  text += lines("nodes", nodes) + ",\n";
  text += lines("cameras", cameras) + ",\n";
  text += "  \"rig\": " + rig(array.truth) + ",\n";
  text += "  \"nominal_rig\": " + rig(array.nominal) + "\n}\n";
  return text;
}

}  // namespace raystage::simulate
