// SPDX-License-Identifier: Apache-2.0
// Reads an animated perspective camera of a glTF 2.0 file. The pose at a time is the product of the
// local transforms of the camera's node and its ancestors, without scale. Animated properties are
// interpolated by STEP, LINEAR (rotations by slerp) or CUBICSPLINE (glTF 2.0, appendix C.5). Input:
// bytes of a .gltf or .glb file. Output: pose (metres) and vertical field of view (radians) as
// functions of the time in seconds. Cost per time: O(log n) for n keys of each animated node.
#include "compose/camera/gltf_camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <utility>

#include "base/atomic_file.h"
#include "compose/camera/animation_curves.h"
#include "compose/camera/gltf_file.h"
#include "schemas/json_text.h"

namespace raystage::compose {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using nlohmann::json;

constexpr double kRigid = 1e-3;  // rounding of float through a few nodes

/// An animated property with `width` numbers per key.
class Sampler {
 public:
  enum class Kind { kStep, kLinear, kCubic };

  Sampler(Kind kind, std::vector<double> times, std::vector<double> values, std::size_t width,
          bool rotation)
      : kind_(kind),
        times_(std::move(times)),
        values_(std::move(values)),
        width_(width),
        rotation_(rotation) {}

  const std::vector<double>& times() const { return times_; }

  std::vector<double> at(double seconds) const {
    const auto [from, to, u] = find_key_interval(times_, seconds);
    std::vector<double> result = key(from);
    if (u > 0 && kind_ == Kind::kLinear) {
      result = rotation_ ? slerp(result, key(to), u) : blend(result, key(to), u);
    }
    if (u > 0 && kind_ == Kind::kCubic) result = spline(from, to, u);
    return result;
  }

 private:
  /// Returns a key. `part` of a CUBICSPLINE key: 0 in-tangent, 1 value, 2 out-tangent.
  std::vector<double> key(std::size_t i, std::size_t part = 1) const {
    const std::size_t begin = kind_ == Kind::kCubic ? (3 * i + part) * width_ : i * width_;
    const auto first = values_.begin() + begin;
    return {first, first + static_cast<std::ptrdiff_t>(width_)};
  }

  static std::vector<double> blend(std::vector<double> a, const std::vector<double>& b, double u) {
    for (std::size_t k = 0; k < a.size(); ++k) a[k] += (b[k] - a[k]) * u;
    return a;
  }

  static std::vector<double> slerp(const std::vector<double>& a, const std::vector<double>& b,
                                   double u) {
    const Quaterniond from(a[3], a[0], a[1], a[2]), to(b[3], b[0], b[1], b[2]);
    const Quaterniond q = from.normalized().slerp(u, to.normalized());
    return {q.x(), q.y(), q.z(), q.w()};
  }

  /// Interpolates by the cubic spline of glTF 2.0, appendix C.5.
  std::vector<double> spline(std::size_t from, std::size_t to, double u) const {
    const double h = times_[to] - times_[from], u2 = u * u, u3 = u2 * u;
    const std::vector<double> p0 = key(from), p1 = key(to), m0 = key(from, 2), m1 = key(to, 0);
    std::vector<double> result(width_);
    for (std::size_t k = 0; k < width_; ++k) {
      result[k] = (2 * u3 - 3 * u2 + 1) * p0[k] + h * (u3 - 2 * u2 + u) * m0[k] +
                  (3 * u2 - 2 * u3) * p1[k] + h * (u3 - u2) * m1[k];
    }
    return result;
  }

  Kind kind_;
  std::vector<double> times_, values_;
  std::size_t width_;
  bool rotation_;
};

using SamplerOf = std::map<std::string, Sampler>;  // by target, such as "/nodes/3/rotation"

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

/// The local transform of a node; samplers replace animated properties.
struct Node {
  std::string path;  ///< "/nodes/3"
  std::vector<double> translation, rotation, scale;
  std::optional<Matrix4d> matrix;

  Matrix4d at(double seconds, const SamplerOf& samplers) const {
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
};

Node node_from(const GltfFile& file, std::size_t index) {
  const json& object = file.element("nodes", index);
  Node node;
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

/// Returns the node and its ancestors, from the root down.
std::vector<Node> nodes_above(const GltfFile& file, std::size_t index) {
  const std::size_t count = file.count("nodes");
  std::vector<std::optional<std::size_t>> parent(count);
  for (std::size_t i = 0; i < count; ++i) {
    const json& node = file.element("nodes", i);
    if (!node.contains("children") || !node["children"].is_array()) continue;
    for (const json& child : node["children"]) {
      file.element("nodes", child);
      parent[child.get<std::size_t>()] = i;
    }
  }
  std::vector<Node> chain;
  for (std::optional<std::size_t> at = index; at; at = parent[*at]) {
    if (chain.size() > count) {
      throw file.input_error("the node is its own ancestor", fmt::format("/nodes/{}", index));
    }
    chain.push_back(node_from(file, *at));
  }
  std::ranges::reverse(chain);
  return chain;
}

std::string text_of(const json& object, const char* key) {
  const auto at = object.find(key);
  return at != object.end() && at->is_string() ? at->get<std::string>() : std::string();
}

/// Returns the time of a frame if that is the same float, else the time itself. A thousand frames
/// after 0 the rounding of a float is worth a hundredth of a pixel of a fast camera.
double corrected_time(double seconds, FrameRate rate) {
  const double exact = std::round(seconds * rate.fps()) / rate.fps();
  constexpr double kRounding = 1e-7;  // of a float, and of a division before
  return std::abs(exact - seconds) <= kRounding * std::abs(seconds) ? exact : seconds;
}

Sampler sampler_from(const GltfFile& file, const json& object, const std::string& target,
                     FrameRate rate, const std::string& where) {
  const std::string name = text_of(object, "interpolation");
  const Sampler::Kind kind = name == "STEP"          ? Sampler::Kind::kStep
                             : name == "CUBICSPLINE" ? Sampler::Kind::kCubic
                                                     : Sampler::Kind::kLinear;
  if (!object.contains("input") || !object.contains("output")) {
    throw file.input_error("the sampler has no input or no output", where);
  }
  const bool rotation = target.ends_with("/rotation");
  const std::size_t width = rotation ? 4 : target.ends_with("/yfov") ? 1 : 3;
  auto times = file.numbers(object["input"], 1);
  for (double& time : times) time = corrected_time(time, rate);
  auto values = file.numbers(object["output"], width);
  const std::size_t parts = kind == Sampler::Kind::kCubic ? 3 : 1;
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
  const std::string path = text_of(target, "path");
  if (path == "pointer") {
    const json& extensions = target.value("extensions", json::object());
    return text_of(extensions.value("KHR_animation_pointer", json::object()), "pointer");
  }
  if (!target.contains("node") || !target["node"].is_number_unsigned()) return {};
  return fmt::format("/nodes/{}/{}", target["node"].get<std::size_t>(), path);
}

/// Returns the samplers of those properties in `wanted` that are animated.
SamplerOf samplers_of(const GltfFile& file, const std::vector<std::string>& wanted,
                      FrameRate rate) {
  SamplerOf samplers;
  for (std::size_t a = 0; a < file.count("animations"); ++a) {
    const json& animation = file.element("animations", a);
    const json channels = animation.value("channels", json::array());
    const json all = animation.value("samplers", json::array());
    for (std::size_t c = 0; c < channels.size(); ++c) {
      const std::string target = target_of(channels[c]);
      if (std::ranges::find(wanted, target) == wanted.end()) continue;
      const std::string where = fmt::format("/animations/{}/channels/{}", a, c);
      const json index = channels[c].value("sampler", json());
      if (!index.is_number_unsigned() || index.get<std::size_t>() >= all.size()) {
        throw file.input_error("the channel has no sampler", where);
      }
      const auto added = samplers.emplace(
          target, sampler_from(file, all[index.get<std::size_t>()], target, rate, where));
      if (!added.second) {
        throw file.input_error(target + " is animated twice", where,
                               "Keep one animation in the file");
      }
    }
  }
  return samplers;
}

/// Returns the pose of a node's transform without its scale.
rig::Pose pose_without_scale(const GltfFile& file, const Matrix4d& world_from_node,
                             const std::string& path) {
  Matrix3d axes = world_from_node.topLeftCorner<3, 3>();
  for (int i = 0; i < 3; ++i) {
    const double length = axes.col(i).norm();
    if (!(length > 0 && std::isfinite(length))) {
      throw file.input_error("the node's scale is 0 or not finite", path, "Give it another scale");
    }
    axes.col(i) /= length;
  }
  const bool skewed = !((axes.transpose() * axes - Matrix3d::Identity()).norm() <= kRigid);
  if (skewed || axes.determinant() < 0) {
    throw file.input_error(
        "the camera's node is mirrored or skewed by its ancestors", path,
        "Freeze its transform, or remove the non-uniform scale of its ancestors");
  }
  return {Quaterniond(axes).normalized().toRotationMatrix(),
          world_from_node.topRightCorner<3, 1>()};
}

/// Reads what the file states about its frames.
void read_timing(const GltfFile& file, const GltfFrameRate& rate, GltfCamera& camera) {
  camera.is_rate_stated = rate.stated.has_value();
  camera.frame_rate = rate.stated.value_or(rate.otherwise);
  const json& asset = file.document().at("asset");
  const auto extras = asset.find("extras");
  if (extras == asset.end() || !extras->is_object()) return;
  if (const auto fps = extras->find("fps"); fps != extras->end()) {
    std::optional<FrameRate> of_file;
    if (fps->is_string()) of_file = frame_rate_from(fps->get<std::string>());
    if (fps->is_number()) of_file = frame_rate_from(fps->get<double>());
    if (!rate.stated) camera.frame_rate = of_file.value_or(rate.otherwise);
    camera.is_rate_stated = true;
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
    camera.first_frame = first->get<int>();
  }
}

struct Found {
  std::size_t node = 0;
  std::string name;
};

Found find_camera(const GltfFile& file, const std::string& name) {
  std::vector<Found> cameras;
  std::string names;
  for (std::size_t i = 0; i < file.count("nodes"); ++i) {
    const json& node = file.element("nodes", i);
    if (!node.contains("camera")) continue;
    const json& camera = file.element("cameras", node["camera"]);
    std::string node_name = text_of(node, "name"), camera_name = text_of(camera, "name");
    if (!name.empty() && node_name != name && camera_name != name) {
      names += (names.empty() ? "" : ", ") + (node_name.empty() ? camera_name : node_name);
      continue;
    }
    cameras.push_back({i, node_name.empty() ? camera_name : node_name});
    if (name.empty()) names += (names.empty() ? "" : ", ") + cameras.back().name;
  }
  if (cameras.size() == 1) return cameras.front();
  if (cameras.empty()) {
    throw file.input_error(name.empty() || names.empty()
                               ? std::string("the file has no camera")
                               : fmt::format("the file has no camera \"{}\", only {}", name, names),
                           "/nodes", "Export the file with its camera, or correct the name");
  }
  throw file.input_error(name.empty()
                             ? fmt::format("the file has {} cameras: {}", cameras.size(), names)
                             : fmt::format("{} cameras are called \"{}\"", cameras.size(), name),
                         "/nodes", "Give the unique name of one of them");
}

}  // namespace

GltfCamera read_gltf_camera(const std::filesystem::path& file, const std::string& name,
                            const GltfFrameRate& rate) {
  return parse_gltf_camera(read_file(file), file, name, rate);
}

GltfCamera parse_gltf_camera(std::string_view bytes, const std::filesystem::path& path,
                             const std::string& name, const GltfFrameRate& rate) {
  const auto file = std::make_shared<const GltfFile>(bytes, path);
  const Found chosen = find_camera(*file, name);
  const json& index = file->element("nodes", chosen.node)["camera"];
  const json& camera = file->element("cameras", index);
  const std::string camera_path = fmt::format("/cameras/{}", index.get<std::size_t>());
  if (text_of(camera, "type") != "perspective" || !camera.contains("perspective") ||
      !camera["perspective"].is_object()) {
    throw file->input_error("the camera is not a perspective camera", camera_path,
                            "Export a perspective camera");
  }
  const json yfov = camera["perspective"].value("yfov", json());
  const auto in_range = [](double v) { return v > 0 && v < std::numbers::pi; };
  if (!yfov.is_number() || !in_range(yfov.get<double>())) {
    throw file->input_error(fmt::format("found {}, allowed: between 0 and pi radians",
                                        schemas::describe_json_value(yfov)),
                            camera_path + "/perspective/yfov", "Correct the field of view");
  }

  const std::vector<Node> nodes = nodes_above(*file, chosen.node);
  const std::string fov_target = camera_path + "/perspective/yfov";
  std::vector<std::string> wanted{fov_target};
  for (const Node& node : nodes) {
    for (const char* property : {"translation", "rotation", "scale"}) {
      wanted.push_back(node.path + "/" + property);
    }
  }
  GltfCamera result;
  result.name = chosen.name;
  read_timing(*file, rate, result);
  const auto samplers =
      std::make_shared<const SamplerOf>(samplers_of(*file, wanted, result.frame_rate));
  for (const auto& [target, sampler] : *samplers) {
    result.key_seconds.insert(result.key_seconds.end(), sampler.times().begin(),
                              sampler.times().end());
  }
  std::ranges::sort(result.key_seconds);
  result.key_seconds.erase(std::unique(result.key_seconds.begin(), result.key_seconds.end()),
                           result.key_seconds.end());
  result.fov_is_animated = samplers->contains(fov_target);
  result.pose = [file, nodes, samplers](double seconds) {
    Matrix4d world_from_node = Matrix4d::Identity();
    for (const Node& node : nodes) world_from_node = world_from_node * node.at(seconds, *samplers);
    return pose_without_scale(*file, world_from_node, nodes.back().path);
  };
  result.vertical_fov = [file, samplers, fov_target, still = yfov.get<double>(),
                         in_range](double seconds) {
    const auto sampler = samplers->find(fov_target);
    const double fov = sampler == samplers->end() ? still : sampler->second.at(seconds).front();
    if (!in_range(fov)) {
      throw file->input_error(
          fmt::format("the field of view is {} radians at {} s, allowed: 0 to pi", fov, seconds),
          fov_target, "Correct its animation");
    }
    return fov;
  };
  return result;
}

}  // namespace raystage::compose
