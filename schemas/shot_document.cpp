// SPDX-License-Identifier: Apache-2.0
#include "schemas/shot_document.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/atomic_file.h"
#include "base/frame_rate.h"
#include "schemas/document.h"
#include "schemas/shot_camera.h"
#include "schemas/shot_geometry.h"
#include "schemas/shot_layer.h"

namespace raystage {
namespace {

using nlohmann::ordered_json;

FrameRate frame_rate_at(const JsonNode& fps) {
  const auto rate = fps.value.is_string() ? frame_rate_from(fps.get<std::string>())
                                          : frame_rate_from(fps.get<double>());
  if (rate) return *rate;
  throw fps.input_error(
      fmt::format("found {}, allowed: a number with up to six decimals, or a ratio as "
                  "text, greater than 0 and up to 1000",
                  describe_json_value(fps.value)),
      "Write the exact ratio, for example \"24000/1001\"");
}

/// Layers around one volume are one picture: nothing can lie between them, or fade one of them.
void check_volumes(const std::vector<ShotDocument::Layer>& layers, const JsonNode& located) {
  for (std::size_t i = 1; i < layers.size(); ++i) {
    if (layers[i].volume.empty()) continue;
    const JsonNode place = located.at(i);
    const auto first = std::ranges::find(layers, layers[i].volume, &ShotDocument::Layer::volume);
    if (first == layers.begin() + static_cast<std::ptrdiff_t>(i)) continue;
    if (layers[i - 1].volume != layers[i].volume) {
      throw place.at("volume").input_error("found another layer between those of the volume",
                                           "List the volume's layers consecutively");
    }
    if (layers[i].opacity != first->opacity || layers[i].holdout != first->holdout) {
      throw place.input_error("found another opacity or holdout than the volume's first layer has",
                              "Give all layers of a volume the same opacity and holdout");
    }
  }
}

}  // namespace

ShotDocument parse_shot(std::string_view text, std::string_view name) {
  const auto [json, version] = parse_versioned_document("shot", text, name);
  const JsonNode document{json, name, ""};
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
        .input_error(fmt::format("found {}, allowed: first_frame, which is {}, or later",
                                 shot.last_frame, shot.first_frame),
                     "Correct the range");
  }
  shot.camera = shot_camera_from(document.at("camera"), version);
  const JsonNode layers = document.at("layers");
  for (std::size_t i = 0; i < layers.size(); ++i)
    shot.layers.push_back(shot_layer_from(layers.at(i)));
  check_volumes(shot.layers, layers);
  if (document.has("lights")) {
    const JsonNode lights = document.at("lights");
    for (std::size_t i = 0; i < lights.size(); ++i) {
      shot.lights.push_back(shot_light_from(lights.at(i)));
    }
  }
  if (document.get("merge", std::string()) == "depth") shot.merge = ShotDocument::Merge::kDepth;
  if (document.has("output")) {
    const JsonNode output = document.at("output");
    shot.output.compression = output.get("compression", shot.output.compression);
    shot.output.data_compression = output.get("data_compression", shot.output.data_compression);
    shot.output.layout = output.get("layout", shot.output.layout);
    shot.output.cryptomatte = output.get("cryptomatte", shot.output.cryptomatte);
    shot.output.overscan = output.get("overscan", shot.output.overscan);
    shot.output.aovs = output.get("aovs", shot.output.aovs);
    if (output.has("color")) {
      const JsonNode color = output.at("color");
      shot.output.color.color_space = color.get("color_space", shot.output.color.color_space);
      if (color.has("config")) shot.output.color.config = path_from(color.at("config"));
      shot.output.color.rec709_space = color.get("rec709_space", shot.output.color.rec709_space);
      shot.output.color.working_space = color.get("working_space", shot.output.color.working_space);
    }
  }
  return shot;
}

std::string format_shot(const ShotDocument& shot) {
  ordered_json json = make_document("shot");
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
  json["camera"] = json_from(shot.camera);
  auto& layers = json["layers"] = ordered_json::array();
  for (const ShotDocument::Layer& layer : shot.layers) layers.push_back(json_from(layer));
  if (!shot.lights.empty()) {
    auto& lights = json["lights"] = nlohmann::ordered_json::array();
    for (const ShotDocument::Light& light : shot.lights) lights.push_back(json_from(light));
  }
  json["merge"] = shot.merge == ShotDocument::Merge::kDepth ? "depth" : "stated";
  auto& output = json["output"] = {{"compression", shot.output.compression}};
  if (!shot.output.data_compression.empty()) {
    output["data_compression"] = shot.output.data_compression;
  }
  output["layout"] = shot.output.layout;
  if (shot.output.cryptomatte) output["cryptomatte"] = true;
  if (shot.output.overscan != std::array{0, 0}) output["overscan"] = shot.output.overscan;
  output["aovs"] = shot.output.aovs;
  const ShotDocument::Color& color = shot.output.color;
  output["color"] = {{"color_space", color.color_space}};
  if (!color.config.empty()) output["color"]["config"] = color.config;
  if (!color.rec709_space.empty()) output["color"]["rec709_space"] = color.rec709_space;
  output["color"]["working_space"] = color.working_space;
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
