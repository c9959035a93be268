// SPDX-License-Identifier: Apache-2.0
#include "replay/server_messages.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/little_endian.h"
#include "render/methods.h"

namespace raystage::replay {
namespace {

using Json = nlohmann::ordered_json;

/// Names from documents may hold bytes that are no UTF-8.
std::string dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Json json_from(const Eigen::Vector3d& point) { return {point.x(), point.y(), point.z()}; }

Json json_from(const Eigen::Matrix3d& rotation) {
  const Eigen::Quaterniond q(rotation);
  return {q.w(), q.x(), q.y(), q.z()};
}

Json json_from(const compose::CameraState& state) {
  Json json{{"position", json_from(state.pose.position)},
            {"orientation", json_from(state.pose.world_from_camera_rotation)},
            {"focal_length_mm", state.focal_length_mm},
            {"film_back_mm", state.film_back_mm}};
  if (state.focus_m) json["focus_m"] = *state.focus_m;
  if (state.f_number) json["f_number"] = *state.f_number;
  return json;
}

Json array_cameras(const rig::Rig& rig) {
  Json cameras = Json::array();
  for (const rig::Rig::Camera& camera : rig.cameras) {
    cameras.push_back({{"id", camera.id},
                       {"position", json_from(camera.pose.position)},
                       {"orientation", json_from(camera.pose.world_from_camera_rotation)}});
  }
  return cameras;
}

Json layers_of(const compose::ShotPlan& plan) {
  Json layers = Json::array();
  for (std::size_t i = 0; i < plan.layers(); ++i) {
    const schemas::ShotDocument::Layer& layer = plan.shot().layers[i];
    Json json{{"name", layer.name}};
    if (const auto* light_field = plan.light_field(i)) {
      json["method"] = layer.method;
      json["cameras"] = array_cameras(light_field->take().rig());
      if (const auto& range = light_field->take().document().depth_range) {
        json["depth_range"] = {range->near, range->far};
      }
    }
    layers.push_back(std::move(json));
  }
  return layers;
}

/// JSON has no infinity.
Json finite_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

}  // namespace

std::string hello_message(std::string_view program_version, std::string_view folder) {
  Json methods = Json::array();
  for (const render::Method* method : render::methods()) {
    methods.push_back({{"name", method->name()},
                       {"summary", method->description().summary},
                       {"artefacts", method->description().artefacts}});
  }
  return dump({{"type", "hello"},
               {"protocol", 1},
               {"version", program_version},
               {"folder", folder},
               {"methods", methods}});
}

std::string shot_message(const ShotMessage& message) {
  const schemas::ShotDocument& shot = message.shot;
  Json path = Json::array();
  constexpr int kMaxFrames = 20'000;  // of the camera's path in one message
  const int last = std::min(shot.last_frame, shot.first_frame + kMaxFrames - 1);
  for (int frame = shot.first_frame; frame <= last; ++frame) {
    path.push_back(json_from(message.camera.state(frame)));
  }
  return dump({{"type", "shot"},
               {"id", message.id},
               {"file", message.file},
               {"text", message.text},
               {"name", shot.name},
               {"width", shot.width},
               {"height", shot.height},
               {"overscan", shot.output.overscan},
               {"fps", shot.fps},
               {"first_frame", shot.first_frame},
               {"last_frame", shot.last_frame},
               {"is_stereo", message.camera.is_stereo()},
               {"layers", layers_of(message.plan)},
               {"path", std::move(path)}});
}

std::string error_message(std::int64_t id, const Error& error) {
  return dump({{"type", "error"},
               {"id", id},
               {"what", error.what_happened()},
               {"where", error.where()},
               {"advice", error.what_to_do()}});
}

std::string dropped_message(std::int64_t id) { return dump({{"type", "dropped"}, {"id", id}}); }

std::string focus_message(std::int64_t id, double distance_m) {
  return dump({{"type", "focus"}, {"id", id}, {"distance_m", distance_m}});
}

std::string probe_message(const ProbeMessage& message) {
  Json json{{"type", "probe"},
            {"id", message.id},
            {"rgba", message.rgba},
            {"display", message.display},
            {"z", finite_or_null(message.z)}};
  if (message.coverage) json["coverage"] = *message.coverage;
  return dump(json);
}

std::string file_message(std::int64_t id, std::string_view what, std::string_view file) {
  return dump({{"type", what}, {"id", id}, {"file", file}});
}

std::vector<std::byte> picture_message(const PictureMessage& header,
                                       std::span<const std::byte> jpeg) {
  Json json{{"type", "picture"},
            {"id", header.id},
            {"frame", header.frame},
            {"width", header.width},
            {"height", header.height},
            {"quality", header.quality},
            {"method", header.method},
            {"final", header.is_final},
            {"uncovered", header.uncovered_share},
            {"render_ms", header.render_ms},
            {"picture_ms", header.picture_ms}};
  if (header.false_colors) {
    json["false_colors"] = {header.false_colors->far, header.false_colors->near};
  }
  if (!header.absent_cameras.empty()) json["absent_cameras"] = header.absent_cameras;
  if (header.is_held) json["held"] = true;
  if (!header.notes.empty()) json["notes"] = header.notes;
  const std::string text = dump(json);
  std::vector<std::byte> message(4 + text.size() + jpeg.size());
  store_little_endian<std::uint32_t>(message, 0, static_cast<std::uint32_t>(text.size()));
  std::ranges::copy(std::as_bytes(std::span(text)), message.begin() + 4);
  std::ranges::copy(jpeg, message.begin() + 4 + static_cast<std::ptrdiff_t>(text.size()));
  return message;
}

}  // namespace raystage::replay
