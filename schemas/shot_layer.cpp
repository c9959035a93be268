// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "schemas/fields.h"
#include "schemas/shot.h"

namespace raystage::schemas {
namespace {

using nlohmann::ordered_json;
using Clip = ShotDocument::Clip;
using FocalPlane = ShotDocument::FocalPlane;
using Layer = ShotDocument::Layer;
using Plate = ShotDocument::Plate;
using ReceivedShadows = ShotDocument::ReceivedShadows;
using ScreenRegion = ShotDocument::ScreenRegion;
using Solid = ShotDocument::Solid;

bool has_normal(const std::array<double, 4>& plane) {
  return plane[0] != 0 || plane[1] != 0 || plane[2] != 0;
}

template <class Key>
void check_key_frames(const JsonNode& key, const std::vector<Key>& keys) {
  if (keys.size() < 2 || keys.back().frame > keys[keys.size() - 2].frame) return;
  throw key.at("frame").input_error("the frame is not after that of the previous key",
                                    "Sort the keys by frame, and keep one key per frame");
}

void check_equation(const JsonNode& plane, const FocalPlane& found) {
  if (has_normal(found.equation)) return;
  throw plane.at("equation")
      .input_error("found a plane without a normal: a, b and c are 0",
                   "Write \"infinity\" for the plane at infinity");
}

constexpr Fields kFocalKey(required("frame", &FocalPlane::Key::frame),
                           required("depth_m", &FocalPlane::Key::depth));
constexpr Fields kDepthPlane(required("depth_m", &FocalPlane::depth));
constexpr Fields kKeyedPlane(required("keys", &FocalPlane::keys,
                                      list_of(kFocalKey, check_key_frames<FocalPlane::Key>)));
constexpr Fields kEquationPlane(required("equation", &FocalPlane::equation), check(check_equation));

FocalPlane focal_plane_from(const JsonNode& plane) {
  if (plane.value == "best") return {.kind = FocalPlane::Kind::kBest};
  if (plane.value == "infinity") return {.kind = FocalPlane::Kind::kInfinity};
  if (plane.value == "camera") return {.kind = FocalPlane::Kind::kCamera};
  FocalPlane result;
  if (plane.has("depth_m")) {
    result.kind = FocalPlane::Kind::kDepth;
    kDepthPlane.read(plane, result);
  } else if (plane.has("keys")) {
    result.kind = FocalPlane::Kind::kKeys;
    kKeyedPlane.read(plane, result);
  } else {
    result.kind = FocalPlane::Kind::kEquation;
    kEquationPlane.read(plane, result);
  }
  return result;
}

ordered_json focal_plane_json(const FocalPlane& plane) {
  switch (plane.kind) {
    case FocalPlane::Kind::kInfinity:
      return "infinity";
    case FocalPlane::Kind::kCamera:
      return "camera";
    case FocalPlane::Kind::kDepth:
      return kDepthPlane.write(plane);
    case FocalPlane::Kind::kEquation:
      return kEquationPlane.write(plane);
    case FocalPlane::Kind::kKeys:
      return kKeyedPlane.write(plane);
    case FocalPlane::Kind::kBest:
      break;
  }
  return "best";
}

constexpr Fields kSolid(required("color", &Solid::color), defaulted("alpha", &Solid::alpha),
                        optional("depth_m", &Solid::depth_m));

constexpr Fields kPlate(required("file", &Plate::file, kPath),
                        optional("frame_offset", &Plate::frame_offset),
                        optional("depth_m", &Plate::depth_m),
                        optional("color_space", &Plate::space));

constexpr Fields kScreenRegion(defaulted("left", &ScreenRegion::left),
                               defaulted("right", &ScreenRegion::right),
                               defaulted("top", &ScreenRegion::top),
                               defaulted("bottom", &ScreenRegion::bottom));

void check_clip(const JsonNode& object, const Clip& clip) {
  if (clip.plane && !has_normal(*clip.plane)) {
    throw object.at("plane").input_error("found a plane without a normal: a, b and c are 0",
                                         "Give a normal that points to the side to keep");
  }
  if (clip.box) check_box(object.at("box"), *clip.box);
  if (clip.screen.left > clip.screen.right || clip.screen.top > clip.screen.bottom) {
    throw object.at("screen").input_error("found an empty part of the picture",
                                          "Give left below right and top below bottom");
  }
}

bool is_screen_clip(const Clip& clip) { return !clip.plane && !clip.box; }

constexpr Fields kClip(
    exactly_one_of("\"plane\", \"box\" and \"screen\"",
                   "Use exactly one per clip; a layer is clipped to all of its clips", "plane",
                   "box", "screen"),
    optional("plane", &Clip::plane), optional("box", &Clip::box),
    written_if(is_screen_clip, defaulted("screen", &Clip::screen, kScreenRegion)),
    check(check_clip), defaulted("feather", &Clip::feather), defaulted("invert", &Clip::inverted));

constexpr Fields kShadows(defaulted("strength", &ReceivedShadows::strength),
                          defaulted("occlusion_distance_m", &ReceivedShadows::occlusion_distance_m),
                          defaulted("rays", &ReceivedShadows::rays));

void check_matte_fill(const JsonNode& object, const Layer& layer) {
  if (!layer.matte || layer.fill == HoleFill::kNone) return;
  throw object.at("fill").input_error("hole filling would fill the transparent areas of the matte",
                                      "Remove \"fill\" or \"matte\"");
}

constexpr Fields kTimeKey(required("frame", &Layer::TimeKey::frame),
                          required("seconds", &Layer::TimeKey::seconds));

void check_layer_time(const JsonNode& object, const Layer& layer) {
  if (layer.time_keys.empty()) return;
  for (const std::string_view other : {"start_seconds", "speed"}) {
    if (!object.has(other)) continue;
    throw object.at(other).input_error("time_keys state the time in the take, too",
                                       "Remove this property or time_keys");
  }
}

bool has_constant_speed(const Layer& layer) { return layer.time_keys.empty(); }
bool has_time_keys(const Layer& layer) { return !layer.time_keys.empty(); }

constexpr Fields kLightField(
    required("take", &Layer::take, kPath), defaulted("method", &Layer::method),
    defaulted("options", &Layer::options, kOptionValues),
    defaulted("focal_plane", &Layer::focal_plane, Converter(focal_plane_from, focal_plane_json)),
    defaulted("fill", &Layer::fill, enum_names<HoleFill>("none", "push_pull")),
    written_if(has_constant_speed, defaulted("start_seconds", &Layer::start_seconds)),
    written_if(has_constant_speed, defaulted("speed", &Layer::speed)),
    written_if(has_time_keys, defaulted("time_keys", &Layer::time_keys,
                                        list_of(kTimeKey, check_key_frames<Layer::TimeKey>))),
    check(check_layer_time),
    defaulted("time", &Layer::time, enum_names<Layer::Time>("tick", "exact")),
    optional("volume", &Layer::volume), optional("receives_shadows", &Layer::shadows, kShadows),
    optional("matte", &Layer::matte, Converter(matte_settings_from, JsonFrom{})),
    check(check_matte_fill));

constexpr auto kContent = custom(
    [](const JsonNode& object, Layer& layer) {
      if (object.has("take")) {
        kLightField.read(object, layer);
      } else {
        reject_keys(object,
                    {"method", "options", "focal_plane", "fill", "start_seconds", "speed",
                     "time_keys", "time", "matte", "volume", "receives_shadows"},
                    "only light field layers have this property",
                    "Remove it, or give the layer a take instead");
      }
    },
    [](const Layer& layer, ordered_json& object) {
      if (!layer.solid && !layer.plate && !layer.geometry) kLightField.write(layer, object);
    });

void check_frames(const JsonNode& object, const Layer& layer) {
  if (!layer.first_frame || !layer.last_frame) return;
  check_frame_range(object, *layer.first_frame, *layer.last_frame);
}

constexpr Fields kLayer(
    exactly_one_of("\"take\", \"geometry\", \"plate\" and \"solid\"",
                   "Give the layer exactly one of these properties", "take", "geometry", "plate",
                   "solid"),
    defaulted("name", &Layer::name), kContent, optional("solid", &Layer::solid, kSolid),
    optional("plate", &Layer::plate, kPlate),
    optional("geometry", &Layer::geometry, Converter(shot_geometry_from, JsonFrom{})),
    optional("clips", &Layer::clips, list_of(kClip)), optional("holdout", &Layer::holdout),
    optional("opacity", &Layer::opacity), optional("first_frame", &Layer::first_frame),
    optional("last_frame", &Layer::last_frame), check(check_frames));

}  // namespace

Layer shot_layer_from(const JsonNode& object, int version) {
  Layer layer = kLayer.make<Layer>(object);
  // A shot that states the focal plane wants to see it; others want to see the scene.
  const bool states_plane = version < 3 || object.has("focal_plane");
  if (layer.is_light_field() && !object.has("method") && !states_plane) {
    layer.method = "plane_sweep";
  }
  return layer;
}

ordered_json json_from(const Layer& layer) { return kLayer.write(layer); }

}  // namespace raystage::schemas
