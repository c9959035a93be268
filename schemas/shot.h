// SPDX-License-Identifier: Apache-2.0
// Internal to schemas/: the JSON of the parts of a shot.
#pragma once

#include <fmt/format.h>

#include <initializer_list>

#include "schemas/fields.h"
#include "schemas/shot_document.h"

namespace raystage::schemas {

/// Reads frames per second: a number or a ratio as text.
FrameRate frame_rate_from(const JsonNode& fps);
nlohmann::ordered_json json_from(const FrameRate& rate);
inline constexpr Converter kFrameRateValue([](const JsonNode& fps) { return frame_rate_from(fps); },
                                           [](const FrameRate& rate) { return json_from(rate); });

/// Reads a camera. `version` is that of the shot's schema; in version 1 a camera is a list of keys.
ShotDocument::Camera shot_camera_from(const JsonNode& camera, int version);
nlohmann::ordered_json json_from(const ShotDocument::Camera& camera);

/// Reads a layer. `version` is that of the shot's schema; it decides the default method.
ShotDocument::Layer shot_layer_from(const JsonNode& object, int version);
nlohmann::ordered_json json_from(const ShotDocument::Layer& layer);

ShotDocument::Geometry shot_geometry_from(const JsonNode& object);
nlohmann::ordered_json json_from(const ShotDocument::Geometry& geometry);

ShotDocument::Light shot_light_from(const JsonNode& object);
nlohmann::ordered_json json_from(const ShotDocument::Light& light);

MatteSettings matte_settings_from(const JsonNode& object);
nlohmann::ordered_json json_from(const MatteSettings& matte);

/// Part of a table: throws Error (bad input) unless the object has exactly one of the keys.
/// `list`: the keys in words.
template <typename... Keys>
constexpr auto exactly_one_of(const char* list, const char* what_to_do, Keys... keys) {
  return check([=](const JsonNode& object, const auto&) {
    const int count = (static_cast<int>(object.has(keys)) + ...);
    if (count == 1) return;
    throw object.input_error(fmt::format("found {} of {}", count, list), what_to_do);
  });
}
/// Throws Error (bad input) for the first of the keys that the object has.
void reject_keys(const JsonNode& object, std::initializer_list<const char*> keys,
                 const std::string& what_happened, const std::string& what_to_do);
/// Throws Error (bad input) for a corner that is not below the other one.
void check_box(const JsonNode& node, const MatteSettings::Box& box);
/// Throws Error (bad input) at "last_frame" if the last frame is before the first.
void check_frame_range(const JsonNode& object, int first, int last);

}  // namespace raystage::schemas
