// SPDX-License-Identifier: Apache-2.0
#include "schemas/record_config.h"

#include <fmt/format.h>

#include "schemas/fields.h"

namespace raystage::schemas {
namespace {

using nlohmann::ordered_json;
using FfmpegSource = RecordConfig::FfmpegSource;
using AravisSource = RecordConfig::AravisSource;
using SimulatedSource = RecordConfig::SimulatedSource;

constexpr auto kWhenFull = enum_names<RecordConfig::OverflowPolicy>("drop_newest", "drop_oldest");
constexpr auto kWhenLost =
    enum_names<RecordConfig::LostSourcePolicy>("continue", "reconnect", "stop");
constexpr auto kChroma = enum_names<RecordConfig::Chroma>("444", "422", "420");

/// Returns a text. Throws Error (bad input) for control characters: libraries may truncate there.
std::string plain_text_from(const JsonNode& text) {
  auto result = text.get<std::string>();
  for (const char c : result) {
    if (static_cast<unsigned char>(c) < ' ') {
      throw text.input_error(
          fmt::format("found {}, text with a control character", describe_json_value(text.value)),
          "Remove the character");
    }
  }
  return result;
}
constexpr Converter kPlainText(plain_text_from, std::identity{});

std::map<std::string, std::string> ffmpeg_options_from(const JsonNode& options) {
  std::map<std::string, std::string> result;
  for (const auto& [key, value] : options.value.items()) {
    if (key.empty() || !value.is_string()) {
      throw options.at(key).input_error(
          fmt::format("found {}, allowed: an option's value as text", describe_json_value(value)),
          "Write it as a string, as on FFmpeg's command line");
    }
    result.emplace(key, plain_text_from(options.at(key)));
  }
  return result;
}

constexpr Fields kFfmpeg(required("url", &FfmpegSource::url, kPlainText),
                         optional("format", &FfmpegSource::format, kPlainText),
                         optional("options", &FfmpegSource::options,
                                  Converter(ffmpeg_options_from, std::identity{})),
                         defaulted("realtime", &FfmpegSource::realtime),
                         optional("max_frame_mb", &FfmpegSource::max_frame_mb));

constexpr Fields kAravis(optional("device", &AravisSource::device, kPlainText),
                         optional("exposure_us", &AravisSource::exposure_us),
                         optional("gain", &AravisSource::gain), optional("fps", &AravisSource::fps),
                         optional("trigger", &AravisSource::trigger, kPlainText),
                         optional("pixel_format", &AravisSource::pixel_format, kPlainText),
                         optional("packet_size", &AravisSource::packet_size),
                         defaulted("buffers", &AravisSource::buffers),
                         defaulted("packet_resend", &AravisSource::packet_resend),
                         defaulted("packet_socket", &AravisSource::packet_socket),
                         defaulted("socket_buffer_bytes", &AravisSource::socket_buffer_bytes));

void check_index(const JsonNode& object, const SimulatedSource& source) {
  const int cameras = source.rows * source.columns;
  if (source.index < cameras) return;
  throw object.at("index").input_error(
      fmt::format("found {}, allowed: less than the {} cameras of the array", source.index,
                  cameras),
      "Correct the index, or \"rows\" and \"columns\"");
}

constexpr Fields kSimulated(
    defaulted("scene", &SimulatedSource::scene, kPlainText),
    defaulted("seed", &SimulatedSource::seed), defaulted("rows", &SimulatedSource::rows),
    defaulted("columns", &SimulatedSource::columns), defaulted("index", &SimulatedSource::index),
    defaulted("width", &SimulatedSource::width), defaulted("height", &SimulatedSource::height),
    defaulted("fps", &SimulatedSource::fps), defaulted("seconds", &SimulatedSource::seconds),
    defaulted("jpeg", &SimulatedSource::jpeg), check(check_index));

RecordConfig::Source source_from(const JsonNode& camera) {
  const bool ffmpeg = camera.has("ffmpeg"), aravis = camera.has("aravis"),
             simulated = camera.has("simulated");
  if (static_cast<int>(ffmpeg) + static_cast<int>(aravis) + static_cast<int>(simulated) != 1) {
    throw camera.input_error(
        fmt::format("found {}, allowed: one of \"ffmpeg\", \"aravis\" and \"simulated\"",
                    ffmpeg || aravis || simulated ? "several sources" : "no source"),
        "Give each camera exactly one source");
  }
  if (ffmpeg) return kFfmpeg.make<FfmpegSource>(camera.at("ffmpeg"));
  if (aravis) return kAravis.make<AravisSource>(camera.at("aravis"));
  return kSimulated.make<SimulatedSource>(camera.at("simulated"));
}

constexpr auto kCameras = custom(
    [](const JsonNode& document, RecordConfig& config) {
      const JsonNode cameras = document.at("cameras");
      std::set<std::string, std::less<>> seen;
      for (std::size_t i = 0; i < cameras.size(); ++i) {
        const JsonNode camera = cameras.at(i);
        config.cameras.push_back({unique_id_from(camera, seen), source_from(camera)});
      }
    },
    [](const RecordConfig& config, ordered_json& document) {
      ordered_json& cameras = document["cameras"] = ordered_json::array();
      for (const RecordConfig::Camera& camera : config.cameras) {
        ordered_json& object = cameras.emplace_back();
        object["id"] = camera.id;
        const auto* ffmpeg = std::get_if<FfmpegSource>(&camera.source);
        const auto* aravis = std::get_if<AravisSource>(&camera.source);
        const auto* simulated = std::get_if<SimulatedSource>(&camera.source);
        if (ffmpeg != nullptr) object["ffmpeg"] = kFfmpeg.write(*ffmpeg);
        if (aravis != nullptr) object["aravis"] = kAravis.write(*aravis);
        if (simulated != nullptr) object["simulated"] = kSimulated.write(*simulated);
      }
    });

/// "jpeg": members of the document.
constexpr Fields kJpeg(defaulted("quality", &RecordConfig::quality),
                       defaulted("chroma", &RecordConfig::chroma, kChroma),
                       optional("restart_interval", &RecordConfig::restart_interval));
constexpr auto kJpegField = custom(
    [](const JsonNode& document, RecordConfig& config) {
      if (document.has("jpeg")) kJpeg.read(document.at("jpeg"), config);
    },
    [](const RecordConfig& config, ordered_json& document) {
      document["jpeg"] = kJpeg.write(config);
    });

constexpr Fields kRecordConfig(required("name", &RecordConfig::name),
                               optional("node", &RecordConfig::node, kPlainText),
                               optional("rig", &RecordConfig::rig, kPath),
                               optional("mirror", &RecordConfig::mirror, kPath),
                               optional("nominal_fps", &RecordConfig::nominal_fps),
                               defaulted("color_space", &RecordConfig::color_space),
                               defaulted("memory_mb", &RecordConfig::memory_mb),
                               optional("memory_ceiling_mb", &RecordConfig::memory_ceiling_mb),
                               defaulted("buffer_in_memory", &RecordConfig::hold),
                               defaulted("when_full", &RecordConfig::when_full, kWhenFull),
                               defaulted("when_lost", &RecordConfig::when_lost, kWhenLost),
                               defaulted("lost_after_seconds", &RecordConfig::lost_after_seconds),
                               kJpegField, kCameras);

}  // namespace

RecordConfig parse_record_config(std::string_view text, std::string_view name) {
  return parse_document_as<RecordConfig>("record", kRecordConfig, text, name);
}

std::string format_record_config(const RecordConfig& config) {
  return format_document("record", kRecordConfig, config);
}

RecordConfig read_record_config(const std::filesystem::path& file) {
  return parse_record_config(read_file(file), file.string());
}

}  // namespace raystage::schemas
