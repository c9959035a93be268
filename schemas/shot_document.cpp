// SPDX-License-Identifier: Apache-2.0
#include "schemas/shot_document.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/frame_rate.h"
#include "schemas/fields.h"
#include "schemas/shot.h"

namespace raystage::schemas {
namespace {

using nlohmann::ordered_json;
using Color = ShotDocument::Color;
using Output = ShotDocument::Output;

/// Throws Error (bad input) unless the layers of a volume, which form one picture, are consecutive
/// and have the same opacity and holdout.
void check_volumes(const JsonNode& document, const ShotDocument& shot) {
  const std::vector<ShotDocument::Layer>& layers = shot.layers;
  for (std::size_t i = 1; i < layers.size(); ++i) {
    if (layers[i].volume.empty()) continue;
    const JsonNode node = document.at("layers").at(i);
    const auto first = std::ranges::find(layers, layers[i].volume, &ShotDocument::Layer::volume);
    if (first == layers.begin() + static_cast<std::ptrdiff_t>(i)) continue;
    if (layers[i - 1].volume != layers[i].volume) {
      throw node.at("volume").input_error("found another layer between those of the volume",
                                          "List the volume's layers consecutively");
    }
    if (layers[i].opacity != first->opacity || layers[i].holdout != first->holdout) {
      throw node.input_error("the opacity or holdout differs from that of the volume's first layer",
                             "Give all layers of a volume the same opacity and holdout");
    }
  }
}

constexpr auto kFrameRate = custom(
    [](const JsonNode& document, ShotDocument& shot) {
      const FrameRate rate = frame_rate_from(document.at("fps"));
      shot.fps = rate.fps();
      shot.fps_numerator = rate.numerator;
      shot.fps_denominator = rate.denominator;
    },
    [](const ShotDocument& shot, ordered_json& document) {
      document["fps"] = json_from(FrameRate{shot.fps_numerator, shot.fps_denominator});
    });

constexpr Fields kFrameRange(required("first_frame", &ShotDocument::first_frame),
                             required("last_frame", &ShotDocument::last_frame),
                             check([](const JsonNode& document, const ShotDocument& shot) {
                               check_frame_range(document, shot.first_frame, shot.last_frame);
                             }));

constexpr Fields kColor(defaulted("color_space", &Color::color_space),
                        optional("config", &Color::config, kPath),
                        optional("rec709_space", &Color::rec709_space),
                        defaulted("working_space", &Color::working_space));

constexpr Fields kOutput(defaulted("compression", &Output::compression),
                         optional("data_compression", &Output::data_compression),
                         optional("layout", &Output::layout),
                         optional("cryptomatte", &Output::cryptomatte),
                         optional("overscan", &Output::overscan), defaulted("aovs", &Output::aovs),
                         optional("motion_samples", &Output::motion_samples),
                         defaulted("color", &Output::color, kColor));

/// Throws Error (bad input) for what an equirectangular camera cannot have.
void check_equirectangular(const JsonNode& object, const ShotDocument& shot) {
  if (shot.camera.projection != ShotDocument::Camera::Projection::kEquirectangular) return;
  const auto refuse = [](const JsonNode& node, const std::string& what, const char* what_to_do) {
    throw node.input_error(what, what_to_do);
  };
  if (shot.width != 2 * shot.height) {
    refuse(object.at("width"),
           fmt::format("found {} x {} pixels; an equirectangular picture is twice as wide as high",
                       shot.width, shot.height),
           "Correct width or height");
  }
  const JsonNode camera = object.at("camera");
  if (shot.camera.dolly_zoom) {
    refuse(camera.at("dolly_zoom"), "an equirectangular camera has no lens to zoom", "Remove it");
  }
  if (shot.camera.stereo && shot.camera.stereo->convergence_m) {
    refuse(camera.at("stereo").at("convergence_m"),
           "the eyes of an equirectangular camera do not converge", "Remove it");
  }
  if (shot.output.overscan != decltype(shot.output.overscan){}) {
    refuse(object.at("output").at("overscan"), "an equirectangular picture has no surroundings",
           "Remove it");
  }
}

/// Before version 3, meshes did not move as their files state, and units of FBX did not count.
void keep_meshes_of_version_two(ShotDocument& shot) {
  for (ShotDocument::Layer& layer : shot.layers) {
    if (layer.geometry) layer.geometry->is_animated = layer.geometry->applies_unit = false;
  }
}

/// Before version 3, shutter_deg was only stated in the header.
void keep_sharp(ShotDocument& shot) { shot.output.motion_samples = 1; }

/// In version 2, glTF's time 0 is the shot's first frame, since version 3 it is frame 0.
void count_gltf_time_from_zero(ShotDocument& shot) {
  auto& file = shot.camera.file;
  if (!file || std::filesystem::path(file->path).extension() == ".chan") return;
  file->frame_offset += shot.first_frame;
  file->fps = FrameRate{shot.fps_numerator, shot.fps_denominator};
}

/// Returns the properties of a shot of schema version `version`.
auto shot_fields(int version) {
  const auto camera_of_version = [version](const JsonNode& camera) {
    return shot_camera_from(camera, version);
  };
  const auto layer_of_version = [version](const JsonNode& layer) {
    return shot_layer_from(layer, version);
  };
  return Fields(
      defaulted("name", &ShotDocument::name), required("width", &ShotDocument::width),
      required("height", &ShotDocument::height), kFrameRate, kFrameRange,
      required("camera", &ShotDocument::camera, Converter(camera_of_version, JsonFrom{})),
      required("layers", &ShotDocument::layers, list_of(Converter(layer_of_version, JsonFrom{}))),
      check(check_volumes),
      optional("lights", &ShotDocument::lights, list_of(Converter(shot_light_from, JsonFrom{}))),
      defaulted("merge", &ShotDocument::merge, enum_names<ShotDocument::Merge>("stated", "depth")),
      defaulted("output", &ShotDocument::output, kOutput), check(check_equirectangular));
}

}  // namespace

FrameRate frame_rate_from(const JsonNode& fps) {
  const auto rate = fps.value.is_string() ? raystage::frame_rate_from(fps.get<std::string>())
                                          : raystage::frame_rate_from(fps.get<double>());
  if (rate) return *rate;
  throw fps.input_error(
      fmt::format("found {}, allowed: a number with up to six decimals, or a ratio as "
                  "text, greater than 0 and up to 1000",
                  describe_json_value(fps.value)),
      "Write the exact ratio, for example \"24000/1001\"");
}

ordered_json json_from(const FrameRate& rate) {
  if (rate.denominator == 1) return rate.numerator;
  return fmt::format("{}/{}", rate.numerator, rate.denominator);
}

void reject_keys(const JsonNode& object, std::initializer_list<const char*> keys,
                 const std::string& what_happened, const std::string& what_to_do) {
  for (const char* key : keys) {
    if (object.has(key)) throw object.at(key).input_error(what_happened, what_to_do);
  }
}

void check_box(const JsonNode& node, const MatteSettings::Box& box) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (box[0][axis] < box[1][axis]) continue;
    throw node.input_error("found an empty box",
                           "Give the corner with the smallest x, y and z first");
  }
}

void check_frame_range(const JsonNode& object, int first, int last) {
  if (first <= last) return;
  throw object.at("last_frame")
      .input_error(fmt::format("found {}, allowed: at least first_frame, which is {}", last, first),
                   "Correct the range");
}

ShotDocument parse_shot(std::string_view text, std::string_view name) {
  const auto [json, version] = parse_versioned_document("shot", text, name);
  ShotDocument shot;
  if (version < 3) shot.output.compression = "piz";  // the default until then
  shot_fields(version).read(JsonNode{json, name, ""}, shot);
  if (version == 2) count_gltf_time_from_zero(shot);
  if (version < 3) keep_meshes_of_version_two(shot);
  if (version < 3) keep_sharp(shot);
  return shot;
}

std::string format_shot(const ShotDocument& shot) {
  return format_document("shot", shot_fields(3), shot);
}

ShotDocument read_shot(const std::filesystem::path& file) {
  return parse_shot(read_file(file), file.string());
}

void write_shot(const ShotDocument& shot, const std::filesystem::path& file) {
  write_document(format_shot(shot), parse_shot, file);
}

}  // namespace raystage::schemas
