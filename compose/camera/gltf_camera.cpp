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
#include <memory>
#include <numbers>
#include <optional>
#include <set>

#include "base/atomic_file.h"
#include "compose/camera/gltf_animation.h"
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

/// Returns the node and its ancestors, from the root down.
std::vector<GltfNode> nodes_above(const GltfFile& file, std::size_t index) {
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
  std::vector<GltfNode> chain;
  for (std::optional<std::size_t> at = index; at; at = parent[*at]) {
    if (chain.size() > count) {
      throw file.input_error("the node is its own ancestor", fmt::format("/nodes/{}", index));
    }
    chain.push_back(read_gltf_node(file, *at));
  }
  std::ranges::reverse(chain);
  return chain;
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
    std::string node_name = gltf_text(node, "name"), camera_name = gltf_text(camera, "name");
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
                           "/nodes",
                           name.empty()
                               ? "Export the file with its camera (Blender: Include > Cameras)"
                               : "Export the file with its camera, or correct the name");
  }
  throw file.input_error(name.empty()
                             ? fmt::format("the file has {} cameras: {}", cameras.size(), names)
                             : fmt::format("{} cameras are called \"{}\"", cameras.size(), name),
                         "/nodes", "Give the unique name of one of them");
}

}  // namespace

GltfCamera read_gltf_camera(const std::filesystem::path& file, const std::string& name,
                            const GltfFrameRate& rate) {
  return parse_gltf_camera(read_file(file, kMaxSceneBytes), file, name, rate);
}

GltfCamera parse_gltf_camera(std::string_view bytes, const std::filesystem::path& path,
                             const std::string& name, const GltfFrameRate& rate) {
  const auto file = std::make_shared<const GltfFile>(bytes, path);
  const Found chosen = find_camera(*file, name);
  const json& index = file->element("nodes", chosen.node)["camera"];
  const json& camera = file->element("cameras", index);
  const std::string camera_path = fmt::format("/cameras/{}", index.get<std::size_t>());
  if (gltf_text(camera, "type") != "perspective" || !camera.contains("perspective") ||
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

  const std::vector<GltfNode> nodes = nodes_above(*file, chosen.node);
  const std::string fov_target = camera_path + "/perspective/yfov";
  std::set<std::string> wanted{fov_target};
  for (const GltfNode& node : nodes) node.add_targets(wanted);
  GltfCamera result;
  result.name = chosen.name;
  result.timing = read_gltf_timing(*file, rate);
  const auto samplers = std::make_shared<const GltfSamplers>(
      read_gltf_samplers(*file, wanted, result.timing.frame_rate));
  result.key_seconds = key_seconds_of(*samplers);
  result.fov_is_animated = samplers->contains(fov_target);
  result.pose = [file, nodes, samplers](double seconds) {
    Matrix4d world_from_node = Matrix4d::Identity();
    for (const GltfNode& node : nodes) {
      world_from_node = world_from_node * node.parent_from_node(seconds, *samplers);
    }
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
