// SPDX-License-Identifier: Apache-2.0
#include "schemas/shot_camera.h"

#include <fmt/format.h>

#include <cmath>

namespace raystage {
namespace {

using nlohmann::ordered_json;
using Camera = ShotDocument::Camera;
using CameraKey = ShotDocument::CameraKey;
using Point = std::array<double, 3>;

std::array<double, 4> quaternion_from(const JsonNode& list) {
  auto q = list.get<std::array<double, 4>>();
  double square = 0;
  for (const double value : q) square += value * value;
  constexpr double kSmallest = 1e-12, kUnit = 1e-14;
  if (square < kSmallest) {
    throw list.input_error("found a quaternion of length 0, allowed: any other length",
                           "Write [1, 0, 0, 0] for no rotation");
  }
  // Left alone when it is unit already, so that reading and writing changes no bit.
  if (std::abs(square - 1) > kUnit) {
    for (double& value : q) value /= std::sqrt(square);
  }
  return q;
}

CameraKey key_from(const JsonNode& object) {
  CameraKey key;
  key.frame = object.at("frame").get<double>();
  key.position = object.get_if<Point>("position");
  if (object.has("orientation")) key.orientation = quaternion_from(object.at("orientation"));
  key.horizontal_fov_deg = object.get_if<double>("horizontal_fov_deg");
  key.focal_length_mm = object.get_if<double>("focal_length_mm");
  if (key.horizontal_fov_deg && key.focal_length_mm) {
    throw object.input_error(
        "found both horizontal_fov_deg and focal_length_mm, allowed: one of them",
        "Remove the other");
  }
  key.target = object.get_if<Point>("target");
  key.roll_deg = object.get_if<double>("roll_deg");
  key.orbit_deg = object.get_if<double>("orbit_deg");
  key.focus_m = object.get_if<double>("focus_m");
  key.f_number = object.get_if<double>("f_number");
  key.shutter_deg = object.get_if<double>("shutter_deg");
  return key;
}

std::vector<CameraKey> keys_from(const JsonNode& list) {
  std::vector<CameraKey> keys;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const CameraKey key = key_from(list.at(i));
    if (!keys.empty() && key.frame <= keys.back().frame) {
      const JsonNode frame = list.at(i).at("frame");
      throw frame.input_error(fmt::format("found {} after {}, allowed: increasing frames",
                                          describe_json_value(frame.value), keys.back().frame),
                              "Sort the keys by frame, and keep one key per frame");
    }
    keys.push_back(key);
  }
  return keys;
}

ShotDocument::CameraFile file_from(const JsonNode& object) {
  ShotDocument::CameraFile file;
  file.path = path_from(object.at("path"));
  file.camera_name = object.get("camera_name", file.camera_name);
  file.rotation_order = object.get("rotation_order", file.rotation_order);
  file.frame_offset = object.get("frame_offset", file.frame_offset);
  return file;
}

ShotDocument::Orbit orbit_from(const JsonNode& object) {
  ShotDocument::Orbit orbit{.center = object.at("center").get<Point>()};
  orbit.axis = object.get("axis", orbit.axis);
  if (orbit.axis == Point{0, 0, 0}) {
    throw object.at("axis").input_error("found an axis of length 0, allowed: any other length",
                                        "Write [0, 1, 0] for an upright one");
  }
  return orbit;
}

ordered_json json_from(const CameraKey& key) {
  ordered_json object{{"frame", key.frame}};
  add_optional(object, "position", key.position);
  add_optional(object, "orientation", key.orientation);
  add_optional(object, "target", key.target);
  add_optional(object, "roll_deg", key.roll_deg);
  add_optional(object, "orbit_deg", key.orbit_deg);
  add_optional(object, "horizontal_fov_deg", key.horizontal_fov_deg);
  add_optional(object, "focal_length_mm", key.focal_length_mm);
  add_optional(object, "focus_m", key.focus_m);
  add_optional(object, "f_number", key.f_number);
  add_optional(object, "shutter_deg", key.shutter_deg);
  return object;
}

ordered_json json_from(const ShotDocument::CameraFile& file) {
  ordered_json object{{"path", file.path}};
  if (!file.camera_name.empty()) object["camera_name"] = file.camera_name;
  object["rotation_order"] = file.rotation_order;
  object["frame_offset"] = file.frame_offset;
  return object;
}

}  // namespace

Camera shot_camera_from(const JsonNode& json, int version) {
  Camera camera;
  if (version == 1) {
    camera.keys = keys_from(json);
    return camera;
  }
  camera.film_back_mm = json.get("film_back_mm", camera.film_back_mm);
  if (json.has("keys")) camera.keys = keys_from(json.at("keys"));
  if (json.has("file")) camera.file = file_from(json.at("file"));
  if (json.has("orbit")) camera.orbit = orbit_from(json.at("orbit"));
  if (json.has("dolly_zoom")) {
    const JsonNode dolly_zoom = json.at("dolly_zoom");
    camera.dolly_zoom = {.target = dolly_zoom.at("target").get<Point>(),
                         .frame = dolly_zoom.get_if<double>("frame")};
  }
  if (json.has("stereo")) {
    const JsonNode object = json.at("stereo");
    ShotDocument::Stereo stereo;
    stereo.interaxial_m = object.get("interaxial_m", stereo.interaxial_m);
    stereo.convergence_m = object.get_if<double>("convergence_m");
    camera.stereo = stereo;
  }
  return camera;
}

ordered_json json_from(const Camera& camera) {
  ordered_json object{{"film_back_mm", camera.film_back_mm}};
  if (camera.file) object["file"] = json_from(*camera.file);
  if (!camera.keys.empty()) {
    auto& keys = object["keys"] = ordered_json::array();
    for (const CameraKey& key : camera.keys) keys.push_back(json_from(key));
  }
  if (camera.orbit) {
    object["orbit"] = {{"center", camera.orbit->center}, {"axis", camera.orbit->axis}};
  }
  if (camera.dolly_zoom) {
    object["dolly_zoom"] = {{"target", camera.dolly_zoom->target}};
    add_optional(object["dolly_zoom"], "frame", camera.dolly_zoom->frame);
  }
  if (camera.stereo) {
    object["stereo"] = {{"interaxial_m", camera.stereo->interaxial_m}};
    add_optional(object["stereo"], "convergence_m", camera.stereo->convergence_m);
  }
  return object;
}

}  // namespace raystage
