// SPDX-License-Identifier: Apache-2.0
#include "compose/camera/camera_channels.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "base/error.h"

namespace raystage::compose {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;
using Key = schemas::ShotDocument::CameraKey;

constexpr double kRadiansPerDegree = std::numbers::pi / 180;

[[noreturn]] void refuse(const std::string& what, const std::string& where,
                         const std::string& what_to_do) {
  throw Error::bad_input(what, where, what_to_do);
}

Quaterniond unit_quaternion(const std::array<double, 4>& q, const std::string& where) {
  const Quaterniond result(q[0], q[1], q[2], q[3]);
  const double norm = result.norm();
  if (!std::isfinite(norm) || norm < 1e-6) {
    refuse("a camera key's orientation is not finite or of length 0", where, "Correct the key");
  }
  return Quaterniond(result.coeffs() / norm);
}

/// Returns the focal length of a key in half image widths, or nullopt.
std::optional<double> focal_of(const Key& key, double film_back_mm, const std::string& where) {
  if (key.horizontal_fov_deg && key.focal_length_mm) {
    refuse("a camera key has both a field of view and a focal length", where,
           "Remove horizontal_fov_deg or focal_length_mm");
  }
  std::optional<double> focal;
  if (key.focal_length_mm) focal = 2 * *key.focal_length_mm / film_back_mm;
  if (key.horizontal_fov_deg) {
    if (!(*key.horizontal_fov_deg > 0 && *key.horizontal_fov_deg < 180)) {
      refuse("a field of view is not between 0 and 180 degrees", where, "Correct the camera key");
    }
    focal = 1 / std::tan(*key.horizontal_fov_deg / 2 * kRadiansPerDegree);
  }
  if (focal && !(std::isfinite(*focal) && *focal > 0)) {
    refuse("a focal length is not a number above 0", where, "Correct the camera key");
  }
  return focal;
}

KeySpeed speed_at(const Key& key, const std::string& where) {
  for (const double share : {key.tension, key.ease_in, key.ease_out}) {
    if (share >= 0 && share <= 1) continue;
    refuse("a tension or ease of a camera key is not between 0 and 1", where, "Correct the key");
  }
  const double kept = 1 - key.tension;
  return {kept * (1 - key.ease_in), kept * (1 - key.ease_out)};
}

/// Returns the curve of one property, or null if no key has it; `value_of(key, where)` returns its
/// value or nullopt.
template <class V, class CurveOfV = Curve<V>, class ValueOf>
AnimationChannel<V> curve_of(const schemas::ShotDocument::Camera& camera, const std::string& where,
                             const ValueOf& value_of) {
  std::vector<CurveKey<V>> keys;
  for (std::size_t i = 0; i < camera.keys.size(); ++i) {
    const std::string at = fmt::format("{}/keys/{}", where, i);
    const std::optional<V> value = value_of(camera.keys[i], at);
    if (value) keys.push_back({camera.keys[i].frame, *value, speed_at(camera.keys[i], at)});
  }
  if (keys.empty()) return nullptr;
  return CurveOfV(keys);
}

/// Returns the curve of a number times `unit`, or null if no key has it.
AnimationChannel<double> number(const schemas::ShotDocument::Camera& camera,
                                const std::string& where, std::optional<double> Key::*property,
                                double unit = 1) {
  return curve_of<double>(
      camera, where, [&](const Key& key, const std::string& at) -> std::optional<double> {
        if (!(key.*property)) return std::nullopt;
        if (!std::isfinite(*(key.*property))) {
          refuse("a value of a camera key is not finite", at, "Correct the key");
        }
        return *(key.*property) * unit;
      });
}

AnimationChannel<Vector3d> point(const schemas::ShotDocument::Camera& camera,
                                 const std::string& where,
                                 std::optional<std::array<double, 3>> Key::*property) {
  return curve_of<Vector3d>(
      camera, where, [&](const Key& key, const std::string& at) -> std::optional<Vector3d> {
        if (!(key.*property)) return std::nullopt;
        const Vector3d value((key.*property)->data());
        if (value.allFinite()) return value;
        refuse("a value of a camera key is not finite", at, "Correct the key");
      });
}

void check_frames(const schemas::ShotDocument::Camera& camera, const std::string& where) {
  for (std::size_t i = 0; i < camera.keys.size(); ++i) {
    const std::string at = fmt::format("{}/keys/{}", where, i);
    if (!std::isfinite(camera.keys[i].frame)) {
      refuse("a camera key's frame is not finite", at, "Correct the key");
    }
    if (i > 0 && !(camera.keys[i].frame > camera.keys[i - 1].frame)) {
      refuse("the frames of the camera keys are not ascending", at,
             "Sort the keys and remove duplicates");
    }
  }
}

template <class V>
void add(AnimationChannel<V>& first, const AnimationChannel<V>& second, const char* name,
         const std::string& where) {
  if (first && second) {
    refuse(fmt::format("both the camera file and the keys give {}", name), where,
           "Remove it from the keys, or remove the camera file");
  }
  if (!first) first = second;
}

}  // namespace

CameraChannels channels_from_keys(const schemas::ShotDocument::Camera& camera,
                                  const std::string& where) {
  check_frames(camera, where);
  CameraChannels channels;
  channels.position = point(camera, where, &Key::position);
  channels.target = point(camera, where, &Key::target);
  channels.orientation = curve_of<Quaterniond, RotationCurve>(
      camera, where, [](const Key& key, const std::string& at) -> std::optional<Quaterniond> {
        if (!key.orientation) return std::nullopt;
        return unit_quaternion(*key.orientation, at);
      });
  channels.focal = curve_of<double>(camera, where, [&](const Key& key, const std::string& at) {
    return focal_of(key, camera.film_back_mm, at);
  });
  channels.roll = number(camera, where, &Key::roll_deg, kRadiansPerDegree);
  channels.shift_x = number(camera, where, &Key::shift_x);
  channels.shift_y = number(camera, where, &Key::shift_y);
  channels.focus = number(camera, where, &Key::focus_m);
  channels.f_number = number(camera, where, &Key::f_number);
  channels.shutter = number(camera, where, &Key::shutter_deg);
  channels.orbit = number(camera, where, &Key::orbit_deg, kRadiansPerDegree);
  return channels;
}

CameraChannels merge_channels(CameraChannels first, const CameraChannels& second,
                              const std::string& where) {
  add(first.position, second.position, "the position", where);
  add(first.orientation, second.orientation, "the orientation", where);
  add(first.target, second.target, "the target", where);
  add(first.roll, second.roll, "the roll", where);
  add(first.focal, second.focal, "the focal length", where);
  add(first.shift_x, second.shift_x, "the horizontal lens shift", where);
  add(first.shift_y, second.shift_y, "the vertical lens shift", where);
  add(first.focus, second.focus, "the focus distance", where);
  add(first.f_number, second.f_number, "the f-number", where);
  add(first.shutter, second.shutter, "the shutter", where);
  add(first.orbit, second.orbit, "the orbit's angle", where);
  return first;
}

}  // namespace raystage::compose
