// SPDX-License-Identifier: Apache-2.0
#include "schemas/shot_document.h"

#include <fmt/format.h>

#include <cmath>

#include "schemas/atomic_file.h"
#include "schemas/document.h"
#include "schemas/frame_rate.h"

namespace raystage {
namespace {

using nlohmann::ordered_json;
using FocalPlane = ShotDocument::FocalPlane;

FrameRate frame_rate_at(const Located& fps) {
  const auto rate = fps.value.is_string() ? frame_rate_from(fps.get<std::string>())
                                          : frame_rate_from(fps.get<double>());
  if (rate) return *rate;
  throw fps.refuse(fmt::format("found {}, allowed: a number with up to six decimals, or a ratio as "
                               "text, greater than 0 and up to 1000",
                               found(fps.value)),
                   "Write the exact ratio, for example \"24000/1001\"");
}

std::array<double, 4> quaternion_from(const Located& list) {
  auto q = list.get<std::array<double, 4>>();
  double square = 0;
  for (const double value : q) square += value * value;
  constexpr double kSmallest = 1e-12, kUnit = 1e-14;
  if (square < kSmallest) {
    throw list.refuse("found a quaternion of length 0, allowed: any other length",
                      "Write [1, 0, 0, 0] for no rotation");
  }
  // Left alone when it is unit already, so that reading and writing changes no bit.
  if (std::abs(square - 1) > kUnit) {
    for (double& value : q) value /= std::sqrt(square);
  }
  return q;
}

FocalPlane focal_plane_from(const Located& plane) {
  if (plane.value == "best") return {.kind = FocalPlane::Kind::kBest};
  if (plane.value == "infinity") return {.kind = FocalPlane::Kind::kInfinity};
  if (plane.has("depth_m")) {
    return {.kind = FocalPlane::Kind::kDepth, .depth = plane.at("depth_m").get<double>()};
  }
  const Located equation = plane.at("equation");
  FocalPlane result{.kind = FocalPlane::Kind::kEquation};
  result.equation = equation.get<std::array<double, 4>>();
  const auto& e = result.equation;
  if (e[0] == 0 && e[1] == 0 && e[2] == 0) {
    throw equation.refuse("found a plane without a normal: a, b and c are 0",
                          "Write \"infinity\" for the plane at infinity");
  }
  return result;
}

ordered_json json_from(const FocalPlane& plane) {
  switch (plane.kind) {
    case FocalPlane::Kind::kInfinity:
      return "infinity";
    case FocalPlane::Kind::kDepth:
      return {{"depth_m", plane.depth}};
    case FocalPlane::Kind::kEquation:
      return {{"equation", plane.equation}};
    case FocalPlane::Kind::kBest:
      break;
  }
  return "best";
}

OptionValues options_from(const Located& object) {
  OptionValues options;
  for (const auto& [name, value] : object.value.items()) {
    if (name.starts_with("x_") || name.starts_with("comment")) continue;
    if (value.is_boolean()) {
      options[name] = value.get<bool>();
    } else if (value.is_number()) {
      options[name] = value.get<double>();
    } else if (value.is_string()) {
      options[name] = value.get<std::string>();
    } else {
      throw object.at(name).refuse(
          fmt::format("found {}, allowed: a number, text, true or false", found(value)),
          "See raystage render --methods for the options that there are");
    }
  }
  return options;
}

ordered_json json_from(const OptionValues& options) {
  ordered_json json = ordered_json::object();
  for (const auto& [name, value] : options) {
    std::visit([&json, &key = name](const auto& of_type) { json[key] = of_type; }, value);
  }
  return json;
}

ShotDocument::Layer layer_from(const Located& object) {
  ShotDocument::Layer layer;
  layer.name = object.get("name", layer.name);
  layer.take = path_text(object.at("take"));
  layer.method = object.get("method", layer.method);
  if (object.has("options")) layer.options = options_from(object.at("options"));
  if (object.has("focal_plane")) layer.focal_plane = focal_plane_from(object.at("focal_plane"));
  if (object.get("fill", std::string()) == "push_pull") layer.fill = HoleFill::kPushPull;
  layer.start_seconds = object.get("start_seconds", layer.start_seconds);
  layer.speed = object.get("speed", layer.speed);
  return layer;
}

std::vector<ShotDocument::CameraKey> keys_from(const Located& list) {
  std::vector<ShotDocument::CameraKey> keys;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const Located object = list.at(i);
    const Located frame = object.at("frame");
    if (!keys.empty() && frame.get<double>() <= keys.back().frame) {
      throw frame.refuse(fmt::format("found {} after {}, allowed: increasing frames",
                                     found(frame.value), keys.back().frame),
                         "Sort the keys by frame, and keep one key per frame");
    }
    keys.push_back({.frame = frame.get<double>(),
                    .position = object.at("position").get<std::array<double, 3>>(),
                    .orientation = quaternion_from(object.at("orientation")),
                    .horizontal_fov_deg = object.at("horizontal_fov_deg").get<double>()});
  }
  return keys;
}

}  // namespace

ShotDocument parse_shot(std::string_view text, std::string_view name) {
  const nlohmann::json json = parse_document("shot", text, name);
  const Located document{json, name, ""};
  ShotDocument shot;
  shot.name = document.get("name", shot.name);
  shot.width = document.at("width").get<int>();
  shot.height = document.at("height").get<int>();
  const FrameRate rate = frame_rate_at(document.at("fps"));
  shot.fps = rate.fps();
  shot.fps_numerator = rate.numerator;
  shot.fps_denominator = rate.denominator;
  shot.first_frame = document.at("first_frame").get<int>();
  shot.last_frame = document.at("last_frame").get<int>();
  if (shot.first_frame > shot.last_frame) {
    throw document.at("last_frame")
        .refuse(fmt::format("found {}, allowed: first_frame, which is {}, or later",
                            shot.last_frame, shot.first_frame),
                "Correct the range");
  }
  shot.camera = keys_from(document.at("camera"));
  const Located layers = document.at("layers");
  for (std::size_t i = 0; i < layers.size(); ++i) shot.layers.push_back(layer_from(layers.at(i)));
  if (document.has("output")) {
    shot.output.compression = document.at("output").get("compression", shot.output.compression);
  }
  return shot;
}

std::string format_shot(const ShotDocument& shot) {
  ordered_json json = new_document("shot");
  json["name"] = shot.name;
  json["width"] = shot.width;
  json["height"] = shot.height;
  if (shot.fps_denominator == 1) {
    json["fps"] = shot.fps_numerator;
  } else {
    json["fps"] = fmt::format("{}/{}", shot.fps_numerator, shot.fps_denominator);
  }
  json["first_frame"] = shot.first_frame;
  json["last_frame"] = shot.last_frame;
  auto& keys = json["camera"] = ordered_json::array();
  for (const ShotDocument::CameraKey& key : shot.camera) {
    keys.push_back({{"frame", key.frame},
                    {"position", key.position},
                    {"orientation", key.orientation},
                    {"horizontal_fov_deg", key.horizontal_fov_deg}});
  }
  auto& layers = json["layers"] = ordered_json::array();
  for (const ShotDocument::Layer& layer : shot.layers) {
    layers.push_back({{"name", layer.name},
                      {"take", layer.take},
                      {"method", layer.method},
                      {"options", json_from(layer.options)},
                      {"focal_plane", json_from(layer.focal_plane)},
                      {"fill", layer.fill == HoleFill::kPushPull ? "push_pull" : "none"},
                      {"start_seconds", layer.start_seconds},
                      {"speed", layer.speed}});
  }
  json["output"] = {{"compression", shot.output.compression}};
  return format_json(json);
}

ShotDocument read_shot(const std::filesystem::path& file) {
  return parse_shot(read_file(file), file.string());
}

void write_shot(const ShotDocument& shot, const std::filesystem::path& file) {
  const std::string text = format_shot(shot);
  parse_shot(text, file.string());  // what cannot be read again must not be written
  write_file_atomically(file, text);
}

}  // namespace raystage
