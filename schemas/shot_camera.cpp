// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>

#include "schemas/fields.h"
#include "schemas/shot.h"

namespace raystage::schemas {
namespace {

using Camera = ShotDocument::Camera;
using CameraFile = ShotDocument::CameraFile;
using CameraKey = ShotDocument::CameraKey;
using DollyZoom = ShotDocument::DollyZoom;
using Orbit = ShotDocument::Orbit;
using Stereo = ShotDocument::Stereo;

std::array<double, 4> quaternion_from(const JsonNode& list) {
  auto q = list.get<std::array<double, 4>>();
  double square = 0;
  for (const double value : q) square += value * value;
  constexpr double kSmallest = 1e-12, kUnit = 1e-14;
  if (square < kSmallest) {
    throw list.input_error("found a quaternion of length 0, allowed: any other length",
                           "Write [1, 0, 0, 0] for no rotation");
  }
  // A unit quaternion is not changed, so that writing reproduces the text that was read.
  if (std::abs(square - 1) > kUnit) {
    for (double& value : q) value /= std::sqrt(square);
  }
  return q;
}

void check_lens(const JsonNode& object, const CameraKey& key) {
  if (!key.horizontal_fov_deg || !key.focal_length_mm) return;
  throw object.input_error(
      "found both horizontal_fov_deg and focal_length_mm, allowed: one of them",
      "Remove one of them");
}

void check_camera_frames(const JsonNode& key, const std::vector<CameraKey>& keys) {
  if (keys.size() < 2 || keys.back().frame > keys[keys.size() - 2].frame) return;
  const JsonNode frame = key.at("frame");
  throw frame.input_error(
      fmt::format("found {} after {}, allowed: increasing frames", describe_json_value(frame.value),
                  keys[keys.size() - 2].frame),
      "Sort the keys by frame, and keep one key per frame");
}

constexpr Fields kCameraKey(
    required("frame", &CameraKey::frame), optional("position", &CameraKey::position),
    optional("orientation", &CameraKey::orientation, Converter(quaternion_from, std::identity{})),
    optional("target", &CameraKey::target), optional("roll_deg", &CameraKey::roll_deg),
    optional("orbit_deg", &CameraKey::orbit_deg),
    optional("horizontal_fov_deg", &CameraKey::horizontal_fov_deg),
    optional("focal_length_mm", &CameraKey::focal_length_mm), check(check_lens),
    optional("shift_x", &CameraKey::shift_x), optional("shift_y", &CameraKey::shift_y),
    optional("focus_m", &CameraKey::focus_m), optional("f_number", &CameraKey::f_number),
    optional("shutter_deg", &CameraKey::shutter_deg), optional("tension", &CameraKey::tension),
    optional("ease_in", &CameraKey::ease_in), optional("ease_out", &CameraKey::ease_out));
constexpr auto kCameraKeys = list_of(kCameraKey, check_camera_frames);

constexpr Fields kCameraFile(required("path", &CameraFile::path, kPath),
                             optional("camera_name", &CameraFile::camera_name),
                             defaulted("rotation_order", &CameraFile::rotation_order),
                             defaulted("frame_offset", &CameraFile::frame_offset),
                             optional("fps", &CameraFile::fps, kFrameRateValue),
                             optional("film_back_height_mm", &CameraFile::film_back_height_mm));

void check_axis(const JsonNode& object, const Orbit& orbit) {
  if (orbit.axis != std::array<double, 3>{0, 0, 0}) return;
  throw object.at("axis").input_error("found an axis of length 0, allowed: any other length",
                                      "Write [0, 1, 0] for a vertical axis");
}

constexpr Fields kOrbit(required("center", &Orbit::center), defaulted("axis", &Orbit::axis),
                        check(check_axis));
constexpr Fields kDollyZoom(required("target", &DollyZoom::target),
                            optional("frame", &DollyZoom::frame));
constexpr Fields kStereo(defaulted("interaxial_m", &Stereo::interaxial_m),
                         optional("convergence_m", &Stereo::convergence_m));

constexpr Fields kCamera(
    defaulted("projection", &Camera::projection,
              enum_names<Camera::Projection>("perspective", "equirectangular")),
    defaulted("film_back_mm", &Camera::film_back_mm), optional("file", &Camera::file, kCameraFile),
    optional("keys", &Camera::keys, kCameraKeys), optional("orbit", &Camera::orbit, kOrbit),
    optional("dolly_zoom", &Camera::dolly_zoom, kDollyZoom),
    optional("stereo", &Camera::stereo, kStereo));

}  // namespace

Camera shot_camera_from(const JsonNode& json, int version) {
  Camera camera;
  if (version == 1) {
    kCameraKeys.read(json, camera.keys);
  } else {
    kCamera.read(json, camera);
  }
  return camera;
}

nlohmann::ordered_json json_from(const Camera& camera) { return kCamera.write(camera); }

}  // namespace raystage::schemas
