// SPDX-License-Identifier: Apache-2.0
#include "replay/server_messages.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>

#include "base/little_endian.h"
#include "base/time.h"
#include "render/methods.h"
#include "rig/lens_summary.h"

namespace raystage::replay {
namespace {

using Json = nlohmann::ordered_json;

/// Names from documents may hold bytes that are no UTF-8.
std::string dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Json json_from(const Eigen::Vector3d& point) { return {point.x(), point.y(), point.z()}; }

Json json_from(const Eigen::Matrix3d& rotation) {
  const Eigen::Quaterniond q(rotation);
  return {q.w(), q.x(), q.y(), q.z()};
}

Json json_from(const compose::CameraState& state) {
  Json json{{"position", json_from(state.pose.position)},
            {"orientation", json_from(state.pose.world_from_camera_rotation)},
            {"focal_length_mm", state.focal_length_mm},
            {"film_back_mm", state.film_back_mm}};
  if (state.shift_x != 0) json["shift_x"] = state.shift_x;
  if (state.shift_y != 0) json["shift_y"] = state.shift_y;
  if (state.focus_m) json["focus_m"] = *state.focus_m;
  if (state.f_number) json["f_number"] = *state.f_number;
  return json;
}

Json array_cameras(const rig::Rig& rig) {
  Json cameras = Json::array();
  for (const rig::Rig::Camera& camera : rig.cameras) {
    Json json{{"id", camera.id},
              {"position", json_from(camera.pose.position)},
              {"orientation", json_from(camera.pose.world_from_camera_rotation)}};
    if (camera.model.fisheye() != nullptr) {
      json["half_angle"] = rig::recorded_half_angle(camera.model);
    }
    cameras.push_back(std::move(json));
  }
  return cameras;
}

Json layers_of(const compose::ShotPlan& plan, int last) {
  Json layers = Json::array();
  for (std::size_t i = 0; i < plan.layers(); ++i) {
    const schemas::ShotDocument::Layer& layer = plan.shot().layers[i];
    Json json{{"name", layer.name}};
    if (const auto* light_field = plan.light_field(i)) {
      json["method"] = layer.method;
      json["cameras"] = array_cameras(light_field->take().rig());
      if (const auto& range = light_field->take().document().depth_range) {
        json["depth_range"] = {range->near, range->far};
      }
      for (int frame = plan.shot().first_frame; frame <= last; ++frame) {
        json["seconds"].push_back(light_field->take_seconds(frame));
      }
    }
    layers.push_back(std::move(json));
  }
  return layers;
}

std::string_view name_of(PictureContent content) {
  switch (content) {
    case PictureContent::kComparison:
      return "comparison";
    case PictureContent::kMosaic:
      return "mosaic";
    case PictureContent::kSource:
      return "source";
    case PictureContent::kEpi:
      return "epi";
    case PictureContent::kThumbnail:
      return "thumbnail";
    case PictureContent::kLive:
      return "live";
    case PictureContent::kView:
      break;
  }
  return "view";
}

Json json_from(const std::vector<MosaicCell>& cells) {
  Json list = Json::array();
  for (const MosaicCell& cell : cells) {
    Json json{{"id", cell.camera_id}, {"box", {cell.x, cell.y, cell.width, cell.height}}};
    if (cell.is_absent) json["absent"] = true;
    list.push_back(std::move(json));
  }
  return list;
}

Json json_from(const EpipolarImage& epi) {
  Json columns = Json::array();
  for (const std::optional<double>& column : epi.focus_columns) {
    columns.push_back(column ? Json(*column) : Json(nullptr));
  }
  return {{"cameras", epi.camera_ids}, {"view_line", epi.view_line}, {"focus_columns", columns}};
}

Json json_from(const std::vector<Eigen::Vector3d>& points) {
  Json list = Json::array();
  for (const Eigen::Vector3d& point : points) list.push_back({point.x(), point.y(), point.z()});
  return list;
}

Json json_from(const std::vector<RangesOfMotion::Range>& ranges) {
  Json list = Json::array();
  for (const RangesOfMotion::Range& range : ranges) {
    list.push_back({{"layer", range.layer},
                    {"vertices", json_from(range.vertices)},
                    {"is_exact", range.is_exact}});
  }
  return list;
}

Json json_from(const LiveStatus& live) {
  Json cameras = Json::array();
  for (const LiveStatus::Camera& camera : live.cameras) {
    Json json{{"id", camera.id}, {"fps", camera.fps}, {"dropped", camera.dropped}};
    if (camera.age_s) json["age_s"] = *camera.age_s;
    cameras.push_back(std::move(json));
  }
  Json json{{"cameras", cameras}, {"is_held", live.is_held}, {"has_ended", live.has_ended}};
  if (live.age_s) json["age_s"] = *live.age_s;
  return json;
}

/// Returns the frames at which cameras are absent: [frame, their number]. kHeld: no camera has one.
Json absences_of(const compose::ShotPlan& plan, int last) {
  constexpr int kHeld = -1;
  Json absences = Json::array();
  std::vector<int> frames(static_cast<std::size_t>(last) - plan.shot().first_frame + 1);
  std::iota(frames.begin(), frames.end(), plan.shot().first_frame);
  const auto planned = plan.plan(frames, compose::MissingFrames::kHold, compose::MotionBlur::kNone);
  for (const compose::PlannedFrame& frame : planned) {
    int absent = 0;
    for (const compose::LightFieldLayer* layer : plan.light_fields()) {
      const compose::ShownTick& tick = frame.shown[layer->index()];
      if (!tick.tick || absent == kHeld) continue;
      const store::FrameSelection selection = layer->frames_of(*tick.tick);
      absent = tick.held ? kHeld
                         : absent + static_cast<int>(selection.frame.size()) - selection.present();
    }
    if (absent != 0) absences.push_back({frame.frame, absent});
  }
  return absences;
}

std::vector<std::byte> with_header(const Json& header, std::span<const std::byte> jpeg) {
  const std::string text = dump(header);
  std::vector<std::byte> message(4 + text.size() + jpeg.size());
  store_little_endian<std::uint32_t>(message, 0, static_cast<std::uint32_t>(text.size()));
  std::ranges::copy(std::as_bytes(std::span(text)), message.begin() + 4);
  std::ranges::copy(jpeg, message.begin() + 4 + static_cast<std::ptrdiff_t>(text.size()));
  return message;
}

/// JSON has no infinity.
Json finite_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

}  // namespace

std::string hello_message(std::string_view program_version, std::string_view folder,
                          const FirstView& first) {
  Json methods = Json::array();
  for (const render::Method* method : render::methods()) {
    methods.push_back({{"name", method->name()},
                       {"summary", method->description().summary},
                       {"uses_focal_plane", method->uses_focal_plane()},
                       {"has_lens", method->has_lens()},
                       {"artefacts", method->description().artefacts}});
  }
  Json json{{"type", "hello"},
            {"protocol", 2},
            {"version", program_version},
            {"folder", folder},
            {"methods", methods}};
  if (!first.live.empty()) {
    json["live"] = first.live;
  } else if (!first.shot) {
    json["list"] = first.folder;
  }
  return dump(json);
}

std::string shot_message(const ShotMessage& message) {
  const schemas::ShotDocument& shot = message.shot;
  Json path = Json::array();
  constexpr int kMaxFrames = 20'000;  // of the camera's path in one message
  const int last = std::min(shot.last_frame, shot.first_frame + kMaxFrames - 1);
  for (int frame = shot.first_frame; frame <= last; ++frame) {
    path.push_back(json_from(message.camera.state(frame)));
  }
  Json measurements = Json::array();
  for (const MethodMeasurement& measured : message.measurements) {
    measurements.push_back({{"method", measured.method},
                            {"psnr_db", measured.psnr_db},
                            {"seconds", measured.seconds_per_frame}});
  }
  Json json{{"type", "shot"},
            {"id", message.id},
            {"file", message.file},
            {"text", message.text},
            {"name", shot.name},
            {"width", shot.width},
            {"height", shot.height},
            {"overscan", shot.output.overscan},
            {"fps", shot.fps},
            {"first_frame", shot.first_frame},
            {"last_frame", shot.last_frame},
            {"is_stereo", message.camera.is_stereo()},
            {"layers", layers_of(message.plan, last)},
            {"path", std::move(path)},
            {"absences", absences_of(message.plan, last)}};
  if (message.is_opened) {
    json["is_opened"] = true;
    json["measurements"] = std::move(measurements);
  }
  if (!message.notes.empty()) json["notes"] = message.notes;
  if (!message.recovered.empty()) json["recovered"] = message.recovered;
  return dump(json);
}

std::string error_message(std::int64_t id, const Error& error) {
  return dump({{"type", "error"},
               {"id", id},
               {"what", error.what_happened()},
               {"where", error.where()},
               {"advice", error.what_to_do()}});
}

std::string dropped_message(std::int64_t id) { return dump({{"type", "dropped"}, {"id", id}}); }

std::string focus_message(std::int64_t id, double distance_m) {
  return dump({{"type", "focus"}, {"id", id}, {"distance_m", distance_m}});
}

std::string probe_message(const ProbeMessage& message) {
  Json json{{"type", "probe"},
            {"id", message.id},
            {"rgba", message.rgba},
            {"display", message.display},
            {"z", finite_or_null(message.z)}};
  if (message.coverage) json["coverage"] = *message.coverage;
  json["cameras"] = Json::array();
  for (const ProbeMessage::Source& source : message.sources) {
    json["cameras"].push_back({source.camera_id, source.share});
  }
  return dump(json);
}

std::string progress_message(std::int64_t id, double share) {
  return dump({{"type", "progress"}, {"id", id}, {"share", share}});
}

std::string keys_message(std::int64_t id, const schemas::ShotDocument& shot) {
  // As the shot's file states them.
  const Json document = Json::parse(schemas::format_shot(shot));
  return dump({{"type", "keys"}, {"id", id}, {"keys", document.at("camera").at("keys")}});
}

std::string live_message(std::int64_t id, const LiveStatus& status) {
  Json json{{"type", "live"}, {"id", id}};
  json.update(json_from(status));
  return dump(json);
}

std::string folder_message(std::int64_t id, std::string_view folder,
                           const std::vector<FolderEntry>& entries) {
  Json list = Json::array();
  for (const FolderEntry& entry : entries) {
    Json json{{"name", entry.name}};
    if (!entry.title.empty()) json["title"] = entry.title;
    if (!entry.problem.empty()) json["problem"] = entry.problem;
    if (entry.kind == FolderEntry::Kind::kTake) {
      json.update({{"kind", "take"},
                   {"cameras", entry.cameras},
                   {"seconds", entry.seconds},
                   {"bytes", entry.bytes},
                   {"is_recording", entry.is_recording}});
      if (entry.recorded_utc > 0) json["recorded"] = format_utc(entry.recorded_utc);
      if (entry.verified_utc) {
        json["verified"] = format_utc(*entry.verified_utc);
        json["is_intact"] = entry.is_intact;
      }
    } else {
      json["kind"] = entry.kind == FolderEntry::Kind::kShot ? "shot" : "folder";
    }
    list.push_back(std::move(json));
  }
  return dump({{"type", "folder"}, {"id", id}, {"file", folder}, {"entries", std::move(list)}});
}

std::string saved_message(std::int64_t id, std::string_view file, std::string_view text) {
  Json json{{"type", "saved"}, {"id", id}, {"file", file}};
  if (!text.empty()) json["text"] = text;
  return dump(json);
}

std::string notes_message(std::int64_t id, std::string_view text) {
  return dump({{"type", "notes"}, {"id", id}, {"text", text}});
}

std::string file_message(std::int64_t id, std::string_view what, std::string_view file) {
  return dump({{"type", what}, {"id", id}, {"file", file}});
}

std::vector<std::byte> picture_message(const PictureMessage& header,
                                       std::span<const std::byte> jpeg) {
  Json json{{"type", "picture"},
            {"content", name_of(header.content)},
            {"id", header.id},
            {"frame", header.frame},
            {"width", header.width},
            {"height", header.height},
            {"quality", header.quality},
            {"method", header.method},
            {"final", header.is_final},
            {"uncovered", header.uncovered_share},
            {"render_ms", header.render_ms},
            {"picture_ms", header.picture_ms}};
  if (header.false_colors) {
    json["false_colors"] = {header.false_colors->far, header.false_colors->near};
  }
  if (header.camera) json["camera"] = json_from(*header.camera);
  if (!header.absent_cameras.empty()) json["absent_cameras"] = header.absent_cameras;
  if (header.is_held) json["held"] = true;
  if (!header.notes.empty()) json["notes"] = header.notes;
  if (!header.ranges.empty()) json["ranges"] = json_from(header.ranges);
  return with_header(json, jpeg);
}

std::string ranges_message(std::int64_t id, std::span<const NestedRange> ranges) {
  Json list = Json::array();
  for (const NestedRange& range : ranges) {
    Json json{{"layers", range.layers},
              {"error_m", range.error_m},
              {"vertices", json_from(range.vertices)},
              {"triangles", range.triangles}};
    if (range.is_of_subject) {
      json["of_subject"] = true;
      if (!range.empty_because.empty()) json["empty_because"] = range.empty_because;
    } else {
      json["share"] = range.share;
    }
    list.push_back(std::move(json));
  }
  return Json{{"type", "ranges"}, {"id", id}, {"ranges", list}}.dump();
}

std::vector<std::byte> source_picture_message(const SourcePictureMessage& header,
                                              std::span<const std::byte> jpeg) {
  Json json{{"type", "picture"},     {"content", name_of(header.content)},
            {"id", header.id},       {"frame", header.frame},
            {"width", header.width}, {"height", header.height}};
  if (!header.camera_id.empty()) json["camera_id"] = header.camera_id;
  if (header.mosaic != nullptr) json["cells"] = json_from(header.mosaic->cells);
  if (header.epi != nullptr) json["epi"] = json_from(*header.epi);
  return with_header(json, jpeg);
}

}  // namespace raystage::replay
