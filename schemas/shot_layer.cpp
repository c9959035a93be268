// SPDX-License-Identifier: Apache-2.0
#include "schemas/shot_layer.h"

#include <fmt/format.h>

#include <algorithm>
#include <initializer_list>

#include "schemas/shot_geometry.h"
#include "schemas/shot_matte.h"

namespace raystage {
namespace {

using nlohmann::ordered_json;
using FocalPlane = ShotDocument::FocalPlane;
using Layer = ShotDocument::Layer;

std::ptrdiff_t count_of(const JsonNode& object, std::initializer_list<const char*> words) {
  return std::ranges::count_if(words, [&](const char* word) { return object.has(word); });
}

FocalPlane focal_plane_from(const JsonNode& plane) {
  if (plane.value == "best") return {.kind = FocalPlane::Kind::kBest};
  if (plane.value == "infinity") return {.kind = FocalPlane::Kind::kInfinity};
  if (plane.value == "camera") return {.kind = FocalPlane::Kind::kCamera};
  if (plane.has("depth_m")) {
    return {.kind = FocalPlane::Kind::kDepth, .depth = plane.at("depth_m").get<double>()};
  }
  if (plane.has("keys")) {
    FocalPlane result{.kind = FocalPlane::Kind::kKeys};
    const JsonNode keys = plane.at("keys");
    for (std::size_t i = 0; i < keys.size(); ++i) {
      const JsonNode key = keys.at(i);
      const double frame = key.at("frame").get<double>();
      if (!result.keys.empty() && !(frame > result.keys.back().frame)) {
        throw key.at("frame").input_error("found a key that does not come after the one before it",
                                          "Order the keys by frame");
      }
      result.keys.push_back({frame, key.at("depth_m").get<double>()});
    }
    return result;
  }
  const JsonNode equation = plane.at("equation");
  FocalPlane result{.kind = FocalPlane::Kind::kEquation};
  result.equation = equation.get<std::array<double, 4>>();
  const auto& e = result.equation;
  if (e[0] == 0 && e[1] == 0 && e[2] == 0) {
    throw equation.input_error("found a plane without a normal: a, b and c are 0",
                               "Write \"infinity\" for the plane at infinity");
  }
  return result;
}

ordered_json json_from(const FocalPlane& plane) {
  switch (plane.kind) {
    case FocalPlane::Kind::kInfinity:
      return "infinity";
    case FocalPlane::Kind::kCamera:
      return "camera";
    case FocalPlane::Kind::kDepth:
      return {{"depth_m", plane.depth}};
    case FocalPlane::Kind::kEquation:
      return {{"equation", plane.equation}};
    case FocalPlane::Kind::kKeys: {
      ordered_json keys = ordered_json::array();
      for (const FocalPlane::Key& key : plane.keys) {
        keys.push_back({{"frame", key.frame}, {"depth_m", key.depth}});
      }
      return {{"keys", keys}};
    }
    case FocalPlane::Kind::kBest:
      break;
  }
  return "best";
}

ShotDocument::Solid solid_from(const JsonNode& object) {
  ShotDocument::Solid solid{.color = object.at("color").get<std::array<double, 3>>()};
  solid.alpha = object.get("alpha", solid.alpha);
  solid.depth_m = object.get_if<double>("depth_m");
  return solid;
}

ordered_json json_from(const ShotDocument::Solid& solid) {
  ordered_json object{{"color", solid.color}, {"alpha", solid.alpha}};
  add_optional(object, "depth_m", solid.depth_m);
  return object;
}

ShotDocument::Plate plate_from(const JsonNode& object) {
  ShotDocument::Plate plate{.file = path_from(object.at("file"))};
  plate.frame_offset = object.get("frame_offset", plate.frame_offset);
  plate.depth_m = object.get_if<double>("depth_m");
  plate.space = object.get("color_space", plate.space);
  return plate;
}

ordered_json json_from(const ShotDocument::Plate& plate) {
  ordered_json object{{"file", plate.file}};
  if (plate.frame_offset != 0) object["frame_offset"] = plate.frame_offset;
  add_optional(object, "depth_m", plate.depth_m);
  if (!plate.space.empty()) object["color_space"] = plate.space;
  return object;
}

ShotDocument::Clip clip_from(const JsonNode& object) {
  if (count_of(object, {"plane", "box", "screen"}) != 1) {
    throw object.input_error("found not exactly one of \"plane\", \"box\" and \"screen\"",
                             "Use one clip for each; a layer is cut to all of its clips");
  }
  ShotDocument::Clip clip;
  clip.feather = object.get("feather", clip.feather);
  clip.inverted = object.get("invert", clip.inverted);
  clip.plane = object.get_if<std::array<double, 4>>("plane");
  clip.box = object.get_if<std::array<std::array<double, 3>, 2>>("box");
  if (clip.plane) {
    const auto& p = *clip.plane;
    if (p[0] == 0 && p[1] == 0 && p[2] == 0) {
      throw object.at("plane").input_error("found a plane without a normal: a, b and c are 0",
                                           "Give the direction of the side that is kept");
    }
  }
  if (clip.box) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if ((*clip.box)[0][axis] < (*clip.box)[1][axis]) continue;
      throw object.at("box").input_error("found a box without an inside",
                                         "Give the corner with the smallest x, y and z first");
    }
  }
  if (object.has("screen")) {
    const JsonNode screen = object.at("screen");
    clip.screen.left = screen.get("left", clip.screen.left);
    clip.screen.right = screen.get("right", clip.screen.right);
    clip.screen.top = screen.get("top", clip.screen.top);
    clip.screen.bottom = screen.get("bottom", clip.screen.bottom);
    if (clip.screen.left > clip.screen.right || clip.screen.top > clip.screen.bottom) {
      throw screen.input_error("found a part of the picture that has no inside",
                               "Give left below right and top below bottom");
    }
  }
  return clip;
}

ordered_json json_from(const ShotDocument::Clip& clip) {
  ordered_json object;
  if (clip.plane) {
    object["plane"] = *clip.plane;
  } else if (clip.box) {
    object["box"] = *clip.box;
  } else {
    object["screen"] = {{"left", clip.screen.left},
                        {"right", clip.screen.right},
                        {"top", clip.screen.top},
                        {"bottom", clip.screen.bottom}};
  }
  object["feather"] = clip.feather;
  object["invert"] = clip.inverted;
  return object;
}

void read_light_field(const JsonNode& object, Layer& layer) {
  layer.take = path_from(object.at("take"));
  layer.method = object.get("method", layer.method);
  if (object.has("options")) layer.options = options_from(object.at("options"));
  if (object.has("focal_plane")) layer.focal_plane = focal_plane_from(object.at("focal_plane"));
  if (object.get("fill", std::string()) == "push_pull") layer.fill = HoleFill::kPushPull;
  layer.start_seconds = object.get("start_seconds", layer.start_seconds);
  layer.speed = object.get("speed", layer.speed);
  layer.volume = object.get("volume", layer.volume);
  if (object.has("receives_shadows")) {
    const JsonNode from = object.at("receives_shadows");
    ShotDocument::ReceivedShadows shadows;
    shadows.strength = from.get("strength", shadows.strength);
    shadows.occlusion_distance_m = from.get("occlusion_distance_m", shadows.occlusion_distance_m);
    shadows.rays = from.get("rays", shadows.rays);
    layer.shadows = shadows;
  }
  if (object.has("matte")) layer.matte = matte_settings_from(object.at("matte"));
  if (layer.matte && layer.fill != HoleFill::kNone) {
    throw object.at("fill").input_error(
        "hole filling would fill the transparent areas of the matte",
        "Remove \"fill\" or \"matte\"");
  }
}

/// Rejects properties of light fields in other layers, where they would have no effect.
void refuse_light_field_words(const JsonNode& object) {
  for (const char* word : {"method", "options", "focal_plane", "fill", "start_seconds", "speed",
                           "matte", "volume", "receives_shadows"}) {
    if (!object.has(word)) continue;
    throw object.at(word).input_error("only light field layers have this property",
                                      "Remove it, or give the layer a take instead");
  }
}

}  // namespace

Layer shot_layer_from(const JsonNode& object) {
  if (count_of(object, {"take", "geometry", "plate", "solid"}) != 1) {
    throw object.input_error(
        "found not exactly one of \"take\", \"geometry\", \"plate\" and \"solid\"",
        "Give the layer exactly one of these properties");
  }
  Layer layer;
  layer.name = object.get("name", layer.name);
  if (object.has("take")) {
    read_light_field(object, layer);
  } else {
    refuse_light_field_words(object);
    if (object.has("solid")) layer.solid = solid_from(object.at("solid"));
    if (object.has("plate")) layer.plate = plate_from(object.at("plate"));
    if (object.has("geometry")) layer.geometry = shot_geometry_from(object.at("geometry"));
  }
  if (object.has("clips")) {
    const JsonNode clips = object.at("clips");
    for (std::size_t i = 0; i < clips.size(); ++i) layer.clips.push_back(clip_from(clips.at(i)));
  }
  layer.holdout = object.get("holdout", layer.holdout);
  layer.opacity = object.get("opacity", layer.opacity);
  layer.first_frame = object.get_if<int>("first_frame");
  layer.last_frame = object.get_if<int>("last_frame");
  if (layer.first_frame && layer.last_frame && *layer.first_frame > *layer.last_frame) {
    throw object.at("last_frame")
        .input_error(fmt::format("found {}, allowed: first_frame, which is {}, or later",
                                 *layer.last_frame, *layer.first_frame),
                     "Correct the range");
  }
  return layer;
}

ordered_json json_from(const Layer& layer) {
  ordered_json object{{"name", layer.name}};
  if (layer.solid) {
    object["solid"] = json_from(*layer.solid);
  } else if (layer.plate) {
    object["plate"] = json_from(*layer.plate);
  } else if (layer.geometry) {
    object["geometry"] = json_from(*layer.geometry);
  } else {
    object["take"] = layer.take;
    object["method"] = layer.method;
    object["options"] = json_from(layer.options);
    object["focal_plane"] = json_from(layer.focal_plane);
    object["fill"] = layer.fill == HoleFill::kPushPull ? "push_pull" : "none";
    object["start_seconds"] = layer.start_seconds;
    object["speed"] = layer.speed;
    if (!layer.volume.empty()) object["volume"] = layer.volume;
    if (layer.shadows) {
      object["receives_shadows"] = {{"strength", layer.shadows->strength},
                                    {"occlusion_distance_m", layer.shadows->occlusion_distance_m},
                                    {"rays", layer.shadows->rays}};
    }
    if (layer.matte) object["matte"] = json_from(*layer.matte);
  }
  if (!layer.clips.empty()) {
    auto& clips = object["clips"] = ordered_json::array();
    for (const ShotDocument::Clip& clip : layer.clips) clips.push_back(json_from(clip));
  }
  if (layer.holdout) object["holdout"] = true;
  if (layer.opacity != 1) object["opacity"] = layer.opacity;
  add_optional(object, "first_frame", layer.first_frame);
  add_optional(object, "last_frame", layer.last_frame);
  return object;
}

}  // namespace raystage
