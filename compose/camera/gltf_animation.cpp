// SPDX-License-Identifier: Apache-2.0
// Interpolates the animated properties of a glTF 2.0 file by STEP, LINEAR (rotations by slerp) or
// CUBICSPLINE (glTF 2.0, appendix C.5). Input: times in seconds, `width` numbers per key. Cost per
// time: O(log n) for n keys.
#include "compose/camera/gltf_animation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "compose/camera/animation_curves.h"
#include "compose/camera/gltf_file.h"
#include "schemas/json_text.h"

namespace raystage::compose {
namespace {

using Eigen::Matrix4d;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using nlohmann::json;

std::vector<double> blend(std::vector<double> a, const std::vector<double>& b, double u) {
  for (std::size_t k = 0; k < a.size(); ++k) a[k] += (b[k] - a[k]) * u;
  return a;
}

std::vector<double> slerp(const std::vector<double>& a, const std::vector<double>& b, double u) {
  const Quaterniond from(a[3], a[0], a[1], a[2]), to(b[3], b[0], b[1], b[2]);
  const Quaterniond q = from.normalized().slerp(u, to.normalized());
  return {q.x(), q.y(), q.z(), q.w()};
}

std::vector<double> list_of(const GltfFile& file, const json& object, const char* key,
                            std::vector<double> otherwise, const std::string& where) {
  const auto at = object.find(key);
  if (at == object.end()) return otherwise;
  std::vector<double> numbers;
  if (at->is_array()) {
    for (const json& value : *at) {
      if (value.is_number() && std::isfinite(value.get<double>())) numbers.push_back(value);
    }
    if (numbers.size() == otherwise.size() && at->size() == otherwise.size()) return numbers;
  }
  throw file.input_error(fmt::format("found {}, allowed: {} numbers",
                                     schemas::describe_json_value(*at), otherwise.size()),
                         where + "/" + key);
}

/// Returns the time of a frame if that is the same float, else the time itself. A thousand frames
/// after 0 the rounding of a float is worth a hundredth of a pixel of a fast camera.
double corrected_time(double seconds, FrameRate rate) {
  const double exact = std::round(seconds * rate.fps()) / rate.fps();
  constexpr double kRounding = 1e-7;  // of a float, and of a division before
  return std::abs(exact - seconds) <= kRounding * std::abs(seconds) ? exact : seconds;
}

GltfSampler sampler_from(const GltfFile& file, const json& object, const std::string& target,
                         FrameRate rate, const std::string& where) {
  const std::string name = gltf_text(object, "interpolation");
  const GltfSampler::Kind kind = name == "STEP"          ? GltfSampler::Kind::kStep
                                 : name == "CUBICSPLINE" ? GltfSampler::Kind::kCubic
                                                         : GltfSampler::Kind::kLinear;
  if (!object.contains("input") || !object.contains("output")) {
    throw file.input_error("the sampler has no input or no output", where);
  }
  const bool rotation = target.ends_with("/rotation");
  const std::size_t width = rotation ? 4 : target.ends_with("/yfov") ? 1 : 3;
  auto times = file.numbers(object["input"], 1);
  for (double& time : times) time = corrected_time(time, rate);
  auto values = file.numbers(object["output"], width);
  const std::size_t parts = kind == GltfSampler::Kind::kCubic ? 3 : 1;
  if (values.size() != times.size() * width * parts) {
    throw file.input_error(fmt::format("the sampler has {} times and {} values", times.size(),
                                       values.size() / width / parts),
                           where);
  }
  if (std::ranges::adjacent_find(times, std::greater_equal<>()) != times.end()) {
    throw file.input_error("the sampler's times are not ascending", where);
  }
  return {kind, std::move(times), std::move(values), width, rotation};
}

/// Returns the property that an animation channel changes, such as "/nodes/3/rotation", or "".
std::string target_of(const json& channel) {
  if (!channel.is_object() || !channel.contains("target") || !channel["target"].is_object()) {
    return {};
  }
  const json& target = channel["target"];
  const std::string path = gltf_text(target, "path");
  if (path == "pointer") {
    const auto extensions = target.find("extensions");
    if (extensions == target.end() || !extensions->is_object()) return {};
    const auto by_pointer = extensions->find("KHR_animation_pointer");
    return by_pointer == extensions->end() ? std::string() : gltf_text(*by_pointer, "pointer");
  }
  if (!target.contains("node") || !target["node"].is_number_unsigned()) return {};
  return fmt::format("/nodes/{}/{}", target["node"].get<std::size_t>(), path);
}

json list_in(const GltfFile& file, const json& object, const char* key, const std::string& where) {
  const auto at = object.find(key);
  if (at == object.end()) return json::array();
  if (at->is_array()) return *at;
  throw file.input_error(
      fmt::format("found {}, allowed: a list", schemas::describe_json_value(*at)),
      where + "/" + key);
}

}  // namespace

std::string gltf_text(const json& object, const char* key) {
  const auto at = object.find(key);
  return at != object.end() && at->is_string() ? at->get<std::string>() : std::string();
}

std::vector<double> GltfSampler::at(double seconds) const {
  const auto [from, to, u] = find_key_interval(times_, seconds);
  std::vector<double> result = key(from);
  if (u > 0 && kind_ == Kind::kLinear) {
    result = is_rotation_ ? slerp(result, key(to), u) : blend(result, key(to), u);
  }
  if (u > 0 && kind_ == Kind::kCubic) result = spline(from, to, u);
  return result;
}

std::vector<double> GltfSampler::key(std::size_t i, std::size_t part) const {
  const std::size_t begin = kind_ == Kind::kCubic ? (3 * i + part) * width_ : i * width_;
  const auto first = values_.begin() + static_cast<std::ptrdiff_t>(begin);
  return {first, first + static_cast<std::ptrdiff_t>(width_)};
}

std::vector<double> GltfSampler::spline(std::size_t from, std::size_t to, double u) const {
  const double h = times_[to] - times_[from], u2 = u * u, u3 = u2 * u;
  const std::vector<double> p0 = key(from), p1 = key(to), m0 = key(from, 2), m1 = key(to, 0);
  std::vector<double> result(width_);
  for (std::size_t k = 0; k < width_; ++k) {
    result[k] = (2 * u3 - 3 * u2 + 1) * p0[k] + h * (u3 - 2 * u2 + u) * m0[k] +
                (3 * u2 - 2 * u3) * p1[k] + h * (u3 - u2) * m1[k];
  }
  return result;
}

Matrix4d GltfNode::parent_from_node(double seconds, const GltfSamplers& samplers) const {
  if (matrix) return *matrix;
  const auto value = [&](const char* property, const std::vector<double>& still) {
    const auto sampler = samplers.find(path + "/" + property);
    return sampler == samplers.end() ? still : sampler->second.at(seconds);
  };
  const auto t = value("translation", translation), r = value("rotation", rotation),
             s = value("scale", scale);
  Matrix4d result = Matrix4d::Identity();
  result.topLeftCorner<3, 3>() =
      Quaterniond(r[3], r[0], r[1], r[2]).normalized() * Vector3d(s[0], s[1], s[2]).asDiagonal();
  result.topRightCorner<3, 1>() = Vector3d(t[0], t[1], t[2]);
  return result;
}

void GltfNode::add_targets(std::set<std::string>& targets) const {
  for (const char* property : {"translation", "rotation", "scale"}) {
    targets.insert(path + "/" + property);
  }
}

GltfNode read_gltf_node(const GltfFile& file, std::size_t index) {
  const json& object = file.element("nodes", index);
  GltfNode node;
  node.path = fmt::format("/nodes/{}", index);
  node.translation = list_of(file, object, "translation", {0, 0, 0}, node.path);
  node.rotation = list_of(file, object, "rotation", {0, 0, 0, 1}, node.path);
  node.scale = list_of(file, object, "scale", {1, 1, 1}, node.path);
  if (object.contains("matrix")) {
    const auto m = list_of(file, object, "matrix", std::vector<double>(16), node.path);
    node.matrix = Eigen::Map<const Matrix4d>(m.data());  // column-major, as Eigen
  }
  return node;
}

GltfSamplers read_gltf_samplers(const GltfFile& file, const std::set<std::string>& wanted,
                                FrameRate rate) {
  constexpr std::size_t kMaxKeys = 10'000'000;
  std::size_t keys = 0;
  GltfSamplers samplers;
  for (std::size_t a = 0; a < file.count("animations"); ++a) {
    const json& animation = file.element("animations", a);
    const std::string path = fmt::format("/animations/{}", a);
    const json channels = list_in(file, animation, "channels", path);
    const json all = list_in(file, animation, "samplers", path);
    for (std::size_t c = 0; c < channels.size(); ++c) {
      const std::string target = target_of(channels[c]);
      if (!wanted.contains(target)) continue;
      const std::string where = fmt::format("/animations/{}/channels/{}", a, c);
      const json index = channels[c].value("sampler", json());
      if (!index.is_number_unsigned() || index.get<std::size_t>() >= all.size()) {
        throw file.input_error("the channel has no sampler", where);
      }
      const auto added = samplers.emplace(
          target, sampler_from(file, all[index.get<std::size_t>()], target, rate, where));
      // Samplers may share accessors, so that the file's size is no limit.
      keys += added.first->second.times().size();
      if (keys > kMaxKeys) {
        throw file.input_error(fmt::format("the animations have more than {} keys", kMaxKeys), path,
                               "Export fewer animated nodes, or fewer frames");
      }
      if (!added.second) {
        throw file.input_error(target + " is animated twice", where,
                               "Keep one animation in the file");
      }
    }
  }
  return samplers;
}

std::vector<double> key_seconds_of(const GltfSamplers& samplers) {
  std::vector<double> seconds;
  for (const auto& [target, sampler] : samplers) {
    seconds.insert(seconds.end(), sampler.times().begin(), sampler.times().end());
  }
  std::ranges::sort(seconds);
  seconds.erase(std::unique(seconds.begin(), seconds.end()), seconds.end());
  return seconds;
}

GltfTiming read_gltf_timing(const GltfFile& file, const GltfFrameRate& rate) {
  GltfTiming timing;
  timing.is_rate_stated = rate.stated.has_value();
  timing.frame_rate = rate.stated.value_or(rate.otherwise);
  const json& asset = file.document().at("asset");
  const auto extras = asset.find("extras");
  if (extras == asset.end() || !extras->is_object()) return timing;
  if (const auto fps = extras->find("fps"); fps != extras->end()) {
    std::optional<FrameRate> of_file;
    if (fps->is_string()) of_file = frame_rate_from(fps->get<std::string>());
    if (fps->is_number()) of_file = frame_rate_from(fps->get<double>());
    if (!rate.stated) timing.frame_rate = of_file.value_or(rate.otherwise);
    timing.is_rate_stated = true;
    if (!of_file) {
      throw file.input_error(
          fmt::format("found {}, allowed: a frame rate", schemas::describe_json_value(*fps)),
          "/asset/extras/fps", "Write a ratio as text, for example \"24000/1001\"");
    }
  }
  if (const auto first = extras->find("first_frame"); first != extras->end()) {
    constexpr int kLimit = 1'000'000'000;
    if (!first->is_number_integer() || std::abs(first->get<double>()) > kLimit) {
      throw file.input_error(
          fmt::format("found {}, allowed: a frame number", schemas::describe_json_value(*first)),
          "/asset/extras/first_frame", "Correct or remove it");
    }
    timing.first_frame = first->get<int>();
  }
  return timing;
}

}  // namespace raystage::compose
