// SPDX-License-Identifier: Apache-2.0
#include "farm/ranks/messages.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <type_traits>
#include <utility>
#include <variant>

#include "base/error.h"
#include "base/resources.h"
#include "farm/ranks/message_checks.h"
#include "store/journal.h"

namespace raystage::farm {
namespace {

using Json = nlohmann::json;

/// Returns a message: [length of the CBOR, 8 bytes][CBOR][arrays].
MessageBytes packed(const Json& head, std::span<const std::span<const std::byte>> arrays = {}) {
  const std::vector<std::uint8_t> cbor = Json::to_cbor(head);
  const std::uint64_t size = cbor.size();
  std::size_t bytes = sizeof(size) + cbor.size();
  for (const auto array : arrays) bytes += array.size();
  MessageBytes message;
  message.reserve(bytes);
  message.resize(sizeof(size) + cbor.size());
  std::memcpy(message.data(), &size, sizeof(size));
  std::memcpy(message.data() + sizeof(size), cbor.data(), cbor.size());
  for (const auto array : arrays) message.insert(message.end(), array.begin(), array.end());
  return message;
}

Error damaged() {
  return Error::failed("a message from another rank is damaged", "MPI",
                       "Run the same program on all ranks, and check the network between them");
}

/// The CBOR of a message, and its arrays that are not read yet.
struct Unpacked {
  Json head;
  std::span<const std::byte> rest;

  std::span<const std::byte> take(std::size_t bytes) {
    if (bytes > rest.size()) throw damaged();
    const auto taken = rest.first(bytes);
    rest = rest.subspan(bytes);
    return taken;
  }
};

Unpacked unpacked(std::span<const std::byte> message) {
  std::uint64_t size = 0;
  if (message.size() < sizeof(size)) throw damaged();
  std::memcpy(&size, message.data(), sizeof(size));
  message = message.subspan(sizeof(size));
  if (size > message.size()) throw damaged();
  const auto cbor = message.first(static_cast<std::size_t>(size));
  if (!is_shallow_cbor(cbor)) throw damaged();
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(cbor.data());
  return {Json::from_cbor(bytes, bytes + cbor.size()), message.subspan(cbor.size())};
}

/// Runs a decoder. Throws Error (failed) for a damaged message.
template <class Decode>
auto decoded(std::span<const std::byte> message, const Decode& decode) {
  try {
    Unpacked parts = unpacked(message);
    return decode(parts);
  } catch (const Json::exception&) {
    throw damaged();
  }
}

/// Returns a value, or values in an array or vector. Throws Error (failed) for an integer that the
/// type does not hold: nlohmann/json converts any number without a check.
template <class T>
T value_of(const Json& json) {
  if constexpr (std::is_integral_v<T> && !std::is_same_v<T, bool>) {
    if (json.is_number_unsigned()) {
      const auto value = json.get<std::uint64_t>();
      if (std::in_range<T>(value)) return static_cast<T>(value);
    } else if (json.is_number_integer()) {
      const auto value = json.get<std::int64_t>();
      if (std::in_range<T>(value)) return static_cast<T>(value);
    }
    throw damaged();
  } else if constexpr (requires(T t) {
                         typename T::value_type;
                         t.resize(1);
                       } &&
                       !std::is_same_v<T, std::string>) {
    T values;
    if (!json.is_array()) throw damaged();
    for (const Json& one : json) values.push_back(value_of<typename T::value_type>(one));
    return values;
  } else if constexpr (requires { std::tuple_size<T>::value; }) {
    T values;
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = value_of<typename T::value_type>(json.at(i));
    }
    return values;
  } else {
    return json.get<T>();
  }
}

template <class T>
std::span<const std::byte> bytes_of(const std::vector<T>& values) {
  static_assert(std::is_trivially_copyable_v<T>);
  return std::as_bytes(std::span(values));
}

template <class T>
std::vector<T> values_of(Unpacked& parts, std::size_t count) {
  static_assert(std::is_trivially_copyable_v<T>);
  if (count > parts.rest.size() / sizeof(T)) throw damaged();
  const auto bytes = parts.take(count * sizeof(T));
  std::vector<T> values(count);
  if (count > 0) std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

Json json_of(const render::VirtualCamera& view) {
  const schemas::Intrinsics& k = view.intrinsics;
  const schemas::Distortion& d = k.distortion;
  const schemas::Matrix4 pose = rig::matrix_from_pose(view.pose);
  return {{"width", view.width},
          {"height", view.height},
          {"intrinsics", {k.fx, k.fy, k.cx, k.cy, d.k1, d.k2, d.p1, d.p2, d.k3}},
          {"pose", pose}};
}

render::VirtualCamera view_from(const Json& json) {
  const auto k = value_of<std::array<double, 9>>(json.at("intrinsics"));
  return {value_of<int>(json.at("width")),
          value_of<int>(json.at("height")),
          {k[0], k[1], k[2], k[3], {k[4], k[5], k[6], k[7], k[8]}},
          rig::pose_from_matrix(value_of<schemas::Matrix4>(json.at("pose")))};
}

Json json_of(const schemas::OptionValues& options) {
  Json json = Json::object();
  for (const auto& [name, value] : options) {
    std::visit([&, key = name](const auto& known) { json[key] = known; }, value);
  }
  return json;
}

schemas::OptionValues options_from(const Json& json) {
  schemas::OptionValues options;
  for (const auto& [name, value] : json.items()) {
    if (value.is_boolean()) options[name] = value_of<bool>(value);
    if (value.is_number()) options[name] = value_of<double>(value);
    if (value.is_string()) options[name] = value_of<std::string>(value);
  }
  return options;
}

/// Returns [camera, later frame, part, line time] of each interpolated frame.
Json interpolated_as_json(const store::FrameSelection& frames) {
  Json list = Json::array();
  for (std::size_t camera = 0; camera < frames.second.size(); ++camera) {
    if (!frames.is_interpolated(camera)) continue;
    const store::FrameSelection::Second& second = frames.second[camera];
    list.push_back({camera, second.frame, second.part, second.line_part});
  }
  return list;
}

std::vector<store::FrameSelection::Second> interpolated_from(const Json& json,
                                                             std::size_t cameras) {
  std::vector<store::FrameSelection::Second> second;
  for (const Json& one : json) {
    const auto camera = value_of<std::size_t>(one.at(0));
    const store::FrameSelection::Second found{value_of<std::int32_t>(one.at(1)),
                                              value_of<double>(one.at(2)),
                                              value_of<double>(one.at(3))};
    if (camera >= cameras || found.frame < 0 || !(found.part >= 0 && found.part <= 1) ||
        !std::isfinite(found.line_part)) {
      throw damaged();
    }
    second.resize(cameras);
    second[camera] = found;
  }
  return second;
}

Json json_of(const render::DistributedViewRequest& view) {
  const Eigen::Vector4d& plane = view.focal_plane;
  Json shown_views = Json::array();
  for (const render::VirtualCamera& shown : view.shown_views) shown_views.push_back(json_of(shown));
  return {{"view", json_of(view.view)},
          {"time", view.frames.time_ns},
          {"frames", view.frames.frame},
          {"interpolated", interpolated_as_json(view.frames)},
          {"frames beside", view.adjacent_frames},
          {"shown views", shown_views},
          {"method", view.method},
          {"options", json_of(view.options)},
          {"plane", {plane[0], plane[1], plane[2], plane[3]}},
          {"supersampling", view.supersampling},
          {"first row", view.first_row},
          {"whole height", view.full_height},
          {"in step", view.is_lockstep}};
}

render::DistributedViewRequest distributed_view_request_from(const Json& json) {
  render::DistributedViewRequest view;
  view.view = view_from(json.at("view"));
  view.frames.time_ns = value_of<Nanoseconds>(json.at("time"));
  view.frames.frame = value_of<std::vector<std::int32_t>>(json.at("frames"));
  view.frames.difference.assign(view.frames.frame.size(), 0);
  view.frames.second = interpolated_from(json.at("interpolated"), view.frames.frame.size());
  view.adjacent_frames = value_of<std::vector<std::vector<int>>>(json.at("frames beside"));
  constexpr std::size_t kMostShownViews = 1024;
  if (json.at("shown views").size() > kMostShownViews) throw damaged();
  for (const Json& shown : json.at("shown views")) view.shown_views.push_back(view_from(shown));
  view.method = value_of<std::string>(json.at("method"));
  view.options = options_from(json.at("options"));
  const auto plane = value_of<std::array<double, 4>>(json.at("plane"));
  view.focal_plane = {plane[0], plane[1], plane[2], plane[3]};
  view.supersampling = value_of<int>(json.at("supersampling"));
  view.first_row = value_of<int>(json.at("first row"));
  view.full_height = value_of<int>(json.at("whole height"));
  view.is_lockstep = value_of<bool>(json.at("in step"));
  return view;
}

Json json_of(const render::RenderStatistics& s) {
  return {s.plan_ms,       s.decode_ms,    s.render_ms,    s.pixels_decoded,
          s.pixels_needed, s.cameras_used, s.working_bytes};
}

render::RenderStatistics statistics_from(const Json& json) {
  render::RenderStatistics s;
  s.plan_ms = value_of<double>(json.at(0));
  s.decode_ms = value_of<double>(json.at(1));
  s.render_ms = value_of<double>(json.at(2));
  s.pixels_decoded = value_of<std::int64_t>(json.at(3));
  s.pixels_needed = value_of<std::int64_t>(json.at(4));
  s.cameras_used = value_of<int>(json.at(5));
  s.working_bytes = value_of<std::size_t>(json.at(6));
  return s;
}

Json json_of(const store::JpegLayout& l) {
  return {{"size", {l.width, l.height}},
          {"components", l.components},
          {"h", l.h},
          {"v", l.v},
          {"mcu", {l.mcu_width, l.mcu_height, l.mcus_per_row, l.mcu_rows}},
          {"restart", l.restart_interval},
          {"baseline", l.baseline_ycc},
          {"offsets", {l.sof_offset, l.scan_offset, l.scan_end}},
          {"segments", l.segment_offset}};
}

store::JpegLayout layout_from(const Json& json) {
  store::JpegLayout l;
  l.width = value_of<int>(json.at("size").at(0));
  l.height = value_of<int>(json.at("size").at(1));
  l.components = value_of<int>(json.at("components"));
  for (std::size_t i = 0; i < 3; ++i) {
    l.h[i] = value_of<int>(json.at("h").at(i));
    l.v[i] = value_of<int>(json.at("v").at(i));
  }
  const auto mcu = value_of<std::array<int, 4>>(json.at("mcu"));
  l.mcu_width = mcu[0];
  l.mcu_height = mcu[1];
  l.mcus_per_row = mcu[2];
  l.mcu_rows = mcu[3];
  l.restart_interval = value_of<int>(json.at("restart"));
  l.baseline_ycc = value_of<bool>(json.at("baseline"));
  const auto offsets = value_of<std::array<std::size_t, 3>>(json.at("offsets"));
  l.sof_offset = offsets[0];
  l.scan_offset = offsets[1];
  l.scan_end = offsets[2];
  l.segment_offset = value_of<std::vector<std::uint32_t>>(json.at("segments"));
  if (!is_valid_layout(l)) throw damaged();
  return l;
}

}  // namespace

MessageBytes encode(const Request& r) {
  Json head{{"kind", static_cast<int>(r.kind)},
            {"reply", r.reply_tag},
            {"take", r.take},
            {"light field", r.light_field},
            {"folder", Json::binary({r.folder.begin(), r.folder.end()})},  // any bytes
            {"memory", {r.cache_bytes, r.result_cache_bytes, r.working_bytes}},
            {"holders", r.camera_owners},
            {"ranks", r.ranks},
            {"number", r.view_number}};
  if (r.kind == Request::Kind::kView) head["view"] = json_of(r.view);
  return packed(head);
}

Request decode_request(std::span<const std::byte> message) {
  return decoded(message, [](const Unpacked& parts) {
    const Json& head = parts.head;
    Request r;
    r.kind = static_cast<Request::Kind>(value_of<int>(head.at("kind")));
    r.reply_tag = value_of<int>(head.at("reply"));
    r.take = value_of<int>(head.at("take"));
    r.light_field = value_of<int>(head.at("light field"));
    const auto& folder = head.at("folder").get_binary();
    r.folder.assign(folder.begin(), folder.end());
    r.cache_bytes = value_of<std::uint64_t>(head.at("memory").at(0));
    r.result_cache_bytes = value_of<std::uint64_t>(head.at("memory").at(1));
    r.working_bytes = value_of<std::uint64_t>(head.at("memory").at(2));
    r.camera_owners = value_of<std::vector<int>>(head.at("holders"));
    r.ranks = value_of<std::vector<int>>(head.at("ranks"));
    r.view_number = value_of<std::uint32_t>(head.at("number"));
    if (r.kind == Request::Kind::kView) r.view = distributed_view_request_from(head.at("view"));
    return r;
  });
}

MessageBytes encode(const TakeTable& table) {
  Json cameras = Json::array();
  std::vector<std::vector<std::byte>> records;  // of each camera
  std::vector<std::span<const std::byte>> arrays;
  for (const TakeTable::Camera& camera : table.cameras) {
    const store::ArchiveWriter::Description& d = camera.description;
    cameras.push_back({camera.is_local, d.camera_id, d.width, d.height, d.epoch_utc,
                       d.codec == store::FrameCodec::kPicture, camera.frames.size(),
                       camera.recorded_xxh3});
    std::vector<std::byte>& bytes = records.emplace_back();
    for (const store::FrameRecord& record : camera.frames) {
      const auto encoded = store::journal::encode_record(record);
      bytes.insert(bytes.end(), encoded.begin(), encoded.end());
    }
  }
  for (const auto& bytes : records) arrays.push_back(bytes);
  return packed({{"cameras", cameras}, {"documents", table.documents}, {"error", table.error}},
                arrays);
}

TakeTable decode_take_table(std::span<const std::byte> message) {
  return decoded(message, [](Unpacked& parts) {
    TakeTable table;
    table.documents = value_of<std::string>(parts.head.at("documents"));
    table.error = value_of<std::string>(parts.head.at("error"));
    for (const Json& entry : parts.head.at("cameras")) {
      TakeTable::Camera camera;
      camera.is_local = value_of<bool>(entry.at(0));
      camera.description = {value_of<std::string>(entry.at(1)), value_of<int>(entry.at(2)),
                            value_of<int>(entry.at(3)), value_of<Nanoseconds>(entry.at(4))};
      // Frames of other forms come as JPEGs.
      camera.description.codec =
          value_of<bool>(entry.at(5)) ? store::FrameCodec::kPicture : store::FrameCodec::kJpeg;
      const auto count = value_of<std::size_t>(entry.at(6));
      if (count > parts.rest.size() / store::journal::kRecordBytes) throw damaged();
      for (std::size_t i = 0; i < count; ++i) {
        const auto record = store::journal::decode_record(parts.take(store::journal::kRecordBytes),
                                                          store::journal::kVersion);
        if (!record) throw damaged();
        camera.frames.push_back(*record);
      }
      camera.recorded_xxh3 = value_of<std::vector<std::uint64_t>>(entry.at(7));
      table.cameras.push_back(std::move(camera));
    }
    return table;
  });
}

MessageBytes encode(const RankCosts& costs) {
  return packed({{"cpu", costs.cpu_seconds},
                 {"waiting", costs.waiting_cpu_seconds},
                 {"sent", costs.bytes_sent}});
}

RankCosts decode_rank_costs(std::span<const std::byte> message) {
  return decoded(message, [](const Unpacked& parts) {
    return RankCosts{value_of<double>(parts.head.at("cpu")),
                     value_of<double>(parts.head.at("waiting")),
                     value_of<std::int64_t>(parts.head.at("sent"))};
  });
}

RankCosts measure_rank_costs(const MpiWorld& world) {
  const MessageCosts costs = world.costs();
  return {cpu_seconds(), costs.waiting_cpu_seconds, costs.bytes_sent};
}

MessageBytes encode(const PartialView& view) {
  std::vector<std::size_t> sizes;
  std::vector<std::span<const std::byte>> arrays;
  for (const MessageBytes& plane : view.planes) {
    sizes.push_back(plane.size());
    arrays.emplace_back(plane);
  }
  return packed({{"error", view.error},
                 {"bad input", view.is_bad_input},
                 {"statistics", json_of(view.statistics)},
                 {"notes", view.notes},
                 {"counts", {view.counts.fragments, view.counts.samples, view.counts.bytes}},
                 {"times", {view.slowest.local_ms, view.slowest.add_ms, view.slowest.encode_ms}},
                 {"planes", sizes}},
                arrays);
}

PartialView decode_partial_view(std::span<const std::byte> message) {
  return decoded(message, [](Unpacked& parts) {
    PartialView view;
    view.error = value_of<std::string>(parts.head.at("error"));
    view.is_bad_input = value_of<bool>(parts.head.at("bad input"));
    view.statistics = statistics_from(parts.head.at("statistics"));
    view.notes = value_of<std::vector<std::string>>(parts.head.at("notes"));
    const auto counts = value_of<std::array<std::int64_t, 3>>(parts.head.at("counts"));
    view.counts = {counts[0], counts[1], counts[2]};
    const auto times = value_of<std::array<double, 3>>(parts.head.at("times"));
    view.slowest = {times[0], times[1], times[2]};
    for (const auto size : value_of<std::vector<std::size_t>>(parts.head.at("planes"))) {
      view.planes.push_back(values_of<std::byte>(parts, size));
    }
    return view;
  });
}

MessageBytes encode(const FrameRequest& r) {
  return packed({{"kind", static_cast<int>(r.kind)},
                 {"reply", r.reply_tag},
                 {"frame", {r.take, r.camera, r.frame}},
                 {"segments", r.segments}});
}

FrameRequest decode_frame_request(std::span<const std::byte> message) {
  return decoded(message, [](const Unpacked& parts) {
    FrameRequest r;
    r.kind = static_cast<FrameRequest::Kind>(value_of<int>(parts.head.at("kind")));
    r.reply_tag = value_of<int>(parts.head.at("reply"));
    if (r.reply_tag < kFirstReplyTag) throw damaged();
    const auto frame = value_of<std::array<int, 3>>(parts.head.at("frame"));
    r.take = frame[0];
    r.camera = frame[1];
    r.frame = frame[2];
    r.segments = value_of<std::vector<std::uint32_t>>(parts.head.at("segments"));
    return r;
  });
}

MessageBytes encode(const FrameReply& reply) {
  const std::span<const std::byte> bytes = reply.bytes;
  const Json layout = reply.layout ? json_of(*reply.layout) : Json();
  return packed({{"error", reply.error}, {"layout", layout}}, std::span(&bytes, 1));
}

FrameReply decode_frame_reply(std::span<const std::byte> message) {
  return decoded(message, [](Unpacked& parts) {
    FrameReply reply;
    reply.error = value_of<std::string>(parts.head.at("error"));
    if (const Json& layout = parts.head.at("layout"); !layout.is_null()) {
      reply.layout = layout_from(layout);
    }
    reply.bytes = values_of<std::byte>(parts, parts.rest.size());
    return reply;
  });
}

}  // namespace raystage::farm
