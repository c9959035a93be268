// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <optional>

#include "base/base64.h"
#include "compose/camera/gltf_camera.h"
#include "schemas/json_text.h"

namespace raystage::compose {
namespace {

using nlohmann::ordered_json;

constexpr int kFloat = 5126;

/// Collects accessors in one buffer of floats.
class Buffer {
 public:
  /// Adds an accessor with `width` values per element. Returns its index.
  std::size_t add(const std::vector<float>& values, std::size_t width, bool with_range) {
    const std::size_t count = values.size() / width;
    views_.push_back({{"buffer", 0},
                      {"byteOffset", bytes_.size()},
                      {"byteLength", values.size() * sizeof(float)}});
    ordered_json accessor{{"bufferView", views_.size() - 1},
                          {"componentType", kFloat},
                          {"count", count},
                          {"type", width == 1   ? "SCALAR"
                                   : width == 3 ? "VEC3"
                                                : "VEC4"}};
    if (with_range) {  // glTF requires it for times
      accessor["min"] = {values.front()};
      accessor["max"] = {values.back()};
    }
    accessors_.push_back(accessor);
    const std::size_t begin = bytes_.size();
    bytes_.resize(begin + values.size() * sizeof(float));
    std::memcpy(bytes_.data() + begin, values.data(), values.size() * sizeof(float));
    return accessors_.size() - 1;
  }

  void write(ordered_json& document) const {
    document["accessors"] = accessors_;
    document["bufferViews"] = views_;
    document["buffers"] = {{{"byteLength", bytes_.size()},
                            {"uri", "data:application/octet-stream;base64," +
                                        encode_base64(std::as_bytes(std::span(bytes_)))}}};
  }

 private:
  std::string bytes_;
  ordered_json views_ = ordered_json::array(), accessors_ = ordered_json::array();
};

void append(std::vector<float>& values, const Eigen::Vector3d& v) {
  for (const double x : v) values.push_back(static_cast<float>(x));
}

struct Tracks {
  std::vector<float> times, positions, rotations, fovs;
};

Tracks tracks_of(std::span<const GltfCameraKey> keys) {
  Tracks tracks;
  Eigen::Quaterniond before = Eigen::Quaterniond::Identity();
  for (const GltfCameraKey& key : keys) {
    tracks.times.push_back(static_cast<float>(key.seconds));
    append(tracks.positions, key.pose.position);
    Eigen::Quaterniond q(key.pose.world_from_camera_rotation);
    if (q.dot(before) < 0) q.coeffs() = -q.coeffs();
    before = q;
    append(tracks.rotations, q.vec());
    tracks.rotations.push_back(static_cast<float>(q.w()));
    tracks.fovs.push_back(static_cast<float>(key.vertical_fov));
  }
  return tracks;
}

bool changes(const std::vector<float>& values, std::size_t width) {
  return !std::equal(values.begin() + width, values.end(), values.begin());
}

}  // namespace

std::string format_gltf_camera(const std::string& name, double aspect,
                               std::span<const GltfCameraKey> keys, FrameRate rate,
                               int first_frame) {
  const Tracks tracks = tracks_of(keys);
  const auto first = [](const std::vector<float>& values, std::size_t width) {
    return std::vector<float>(values.begin(), values.begin() + width);
  };
  const ordered_json timing{{"fps", fmt::format("{}/{}", rate.numerator, rate.denominator)},
                            {"first_frame", first_frame}};
  ordered_json document{
      {"asset", {{"version", "2.0"}, {"generator", "Raystage"}, {"extras", timing}}},
      {"scene", 0},
      {"scenes", {{{"nodes", {0}}}}}};
  document["nodes"] = {{{"name", name},
                        {"camera", 0},
                        {"translation", first(tracks.positions, 3)},
                        {"rotation", first(tracks.rotations, 4)}}};
  document["cameras"] = {
      {{"name", name},
       {"type", "perspective"},
       {"perspective", {{"aspectRatio", aspect}, {"yfov", tracks.fovs.front()}, {"znear", 0.01}}}}};

  Buffer buffer;
  ordered_json channels = ordered_json::array(), samplers = ordered_json::array();
  std::optional<std::size_t> input;
  const auto animate = [&](const std::vector<float>& values, std::size_t width,
                           const ordered_json& target) {
    if (!changes(values, width)) return;
    if (!input) input = buffer.add(tracks.times, 1, true);
    samplers.push_back({{"input", *input},
                        {"interpolation", "LINEAR"},
                        {"output", buffer.add(values, width, false)}});
    channels.push_back({{"sampler", samplers.size() - 1}, {"target", target}});
  };
  animate(tracks.positions, 3, {{"node", 0}, {"path", "translation"}});
  animate(tracks.rotations, 4, {{"node", 0}, {"path", "rotation"}});
  const bool zooms = changes(tracks.fovs, 1);
  animate(
      tracks.fovs, 1,
      {{"path", "pointer"},
       {"extensions", {{"KHR_animation_pointer", {{"pointer", "/cameras/0/perspective/yfov"}}}}}});
  if (zooms) document["extensionsUsed"] = {"KHR_animation_pointer"};
  if (!channels.empty()) {
    document["animations"] = {{{"name", name}, {"channels", channels}, {"samplers", samplers}}};
    buffer.write(document);
  }
  return schemas::format_json(document);
}

}  // namespace raystage::compose
