// SPDX-License-Identifier: Apache-2.0
#include "farm/ranks/messages.h"

#include <cstring>
#include <nlohmann/json.hpp>
#include <type_traits>
#include <utility>
#include <variant>

#include "base/error.h"
#include "base/resources.h"

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
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(message.data());
  return {Json::from_cbor(bytes, bytes + size), message.subspan(static_cast<std::size_t>(size))};
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
  const auto k = json.at("intrinsics").get<std::array<double, 9>>();
  return {json.at("width").get<int>(),
          json.at("height").get<int>(),
          {k[0], k[1], k[2], k[3], {k[4], k[5], k[6], k[7], k[8]}},
          rig::pose_from_matrix(json.at("pose").get<schemas::Matrix4>())};
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
    if (value.is_boolean()) options[name] = value.get<bool>();
    if (value.is_number()) options[name] = value.get<double>();
    if (value.is_string()) options[name] = value.get<std::string>();
  }
  return options;
}

Json json_of(const render::DistributedViewRequest& view) {
  const Eigen::Vector4d& plane = view.focal_plane;
  return {{"view", json_of(view.view)},
          {"time", view.frames.time_ns},
          {"frames", view.frames.frame},
          {"frames beside", view.adjacent_frames},
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
  view.frames.time_ns = json.at("time").get<Nanoseconds>();
  view.frames.frame = json.at("frames").get<std::vector<std::int32_t>>();
  view.frames.difference.assign(view.frames.frame.size(), 0);
  view.adjacent_frames = json.at("frames beside").get<std::vector<std::vector<int>>>();
  view.method = json.at("method").get<std::string>();
  view.options = options_from(json.at("options"));
  const auto plane = json.at("plane").get<std::array<double, 4>>();
  view.focal_plane = {plane[0], plane[1], plane[2], plane[3]};
  view.supersampling = json.at("supersampling").get<int>();
  view.first_row = json.at("first row").get<int>();
  view.full_height = json.at("whole height").get<int>();
  view.is_lockstep = json.at("in step").get<bool>();
  return view;
}

Json json_of(const render::RenderStatistics& s) {
  return {s.plan_ms,       s.decode_ms,    s.render_ms,    s.pixels_decoded,
          s.pixels_needed, s.cameras_used, s.working_bytes};
}

render::RenderStatistics statistics_from(const Json& json) {
  render::RenderStatistics s;
  s.plan_ms = json.at(0).get<double>();
  s.decode_ms = json.at(1).get<double>();
  s.render_ms = json.at(2).get<double>();
  s.pixels_decoded = json.at(3).get<std::int64_t>();
  s.pixels_needed = json.at(4).get<std::int64_t>();
  s.cameras_used = json.at(5).get<int>();
  s.working_bytes = json.at(6).get<std::size_t>();
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
  l.width = json.at("size").at(0).get<int>();
  l.height = json.at("size").at(1).get<int>();
  l.components = json.at("components").get<int>();
  for (std::size_t i = 0; i < 3; ++i) {
    l.h[i] = json.at("h").at(i).get<int>();
    l.v[i] = json.at("v").at(i).get<int>();
  }
  const auto mcu = json.at("mcu").get<std::array<int, 4>>();
  l.mcu_width = mcu[0];
  l.mcu_height = mcu[1];
  l.mcus_per_row = mcu[2];
  l.mcu_rows = mcu[3];
  l.restart_interval = json.at("restart").get<int>();
  l.baseline_ycc = json.at("baseline").get<bool>();
  const auto offsets = json.at("offsets").get<std::array<std::size_t, 3>>();
  l.sof_offset = offsets[0];
  l.scan_offset = offsets[1];
  l.scan_end = offsets[2];
  l.segment_offset = json.at("segments").get<std::vector<std::uint32_t>>();
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
    r.kind = static_cast<Request::Kind>(head.at("kind").get<int>());
    r.reply_tag = head.at("reply").get<int>();
    r.take = head.at("take").get<int>();
    r.light_field = head.at("light field").get<int>();
    const auto& folder = head.at("folder").get_binary();
    r.folder.assign(folder.begin(), folder.end());
    r.cache_bytes = head.at("memory").at(0).get<std::uint64_t>();
    r.result_cache_bytes = head.at("memory").at(1).get<std::uint64_t>();
    r.working_bytes = head.at("memory").at(2).get<std::uint64_t>();
    r.camera_owners = head.at("holders").get<std::vector<int>>();
    r.ranks = head.at("ranks").get<std::vector<int>>();
    r.view_number = head.at("number").get<std::uint32_t>();
    if (r.kind == Request::Kind::kView) r.view = distributed_view_request_from(head.at("view"));
    return r;
  });
}

MessageBytes encode(const TakeTable& table) {
  Json cameras = Json::array();
  std::vector<std::span<const std::byte>> arrays;
  for (const TakeTable::Camera& camera : table.cameras) {
    const store::ArchiveWriter::Description& d = camera.description;
    cameras.push_back(
        {camera.is_local, d.camera_id, d.width, d.height, d.epoch_utc, camera.frames.size()});
    arrays.push_back(bytes_of(camera.frames));
  }
  return packed({{"cameras", cameras}, {"documents", table.documents}, {"error", table.error}},
                arrays);
}

TakeTable decode_take_table(std::span<const std::byte> message) {
  return decoded(message, [](Unpacked& parts) {
    TakeTable table;
    table.documents = parts.head.at("documents").get<std::string>();
    table.error = parts.head.at("error").get<std::string>();
    for (const Json& entry : parts.head.at("cameras")) {
      TakeTable::Camera camera;
      camera.is_local = entry.at(0).get<bool>();
      camera.description = {entry.at(1).get<std::string>(), entry.at(2).get<int>(),
                            entry.at(3).get<int>(), entry.at(4).get<Nanoseconds>()};
      camera.frames = values_of<store::FrameRecord>(parts, entry.at(5).get<std::size_t>());
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
    return RankCosts{parts.head.at("cpu").get<double>(), parts.head.at("waiting").get<double>(),
                     parts.head.at("sent").get<std::int64_t>()};
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
    view.error = parts.head.at("error").get<std::string>();
    view.is_bad_input = parts.head.at("bad input").get<bool>();
    view.statistics = statistics_from(parts.head.at("statistics"));
    view.notes = parts.head.at("notes").get<std::vector<std::string>>();
    const auto counts = parts.head.at("counts").get<std::array<std::int64_t, 3>>();
    view.counts = {counts[0], counts[1], counts[2]};
    const auto times = parts.head.at("times").get<std::array<double, 3>>();
    view.slowest = {times[0], times[1], times[2]};
    for (const auto size : parts.head.at("planes").get<std::vector<std::size_t>>()) {
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
    r.kind = static_cast<FrameRequest::Kind>(parts.head.at("kind").get<int>());
    r.reply_tag = parts.head.at("reply").get<int>();
    const auto frame = parts.head.at("frame").get<std::array<int, 3>>();
    r.take = frame[0];
    r.camera = frame[1];
    r.frame = frame[2];
    r.segments = parts.head.at("segments").get<std::vector<std::uint32_t>>();
    return r;
  });
}

MessageBytes encode(const FrameReply& reply) {
  const std::span<const std::byte> bytes = reply.bytes;
  return packed({{"error", reply.error}, {"layout", json_of(reply.layout)}}, std::span(&bytes, 1));
}

FrameReply decode_frame_reply(std::span<const std::byte> message) {
  return decoded(message, [](Unpacked& parts) {
    FrameReply reply;
    reply.error = parts.head.at("error").get<std::string>();
    reply.layout = layout_from(parts.head.at("layout"));
    reply.bytes = values_of<std::byte>(parts, parts.rest.size());
    return reply;
  });
}

}  // namespace raystage::farm
