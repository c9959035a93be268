// SPDX-License-Identifier: Apache-2.0
// Writes ranges of motion and cameras as glTF 2.0 (Khronos Group). Meshes are in the array's frame,
// so that arrays far from the world's origin keep their precision; a node has its pose.
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "base/base64.h"
#include "planning/coverage_report.h"
#include "schemas/json_text.h"

namespace raystage::planning {
namespace {

using nlohmann::ordered_json;

constexpr int kFloat = 5126, kUnsignedInt = 5125, kVertices = 34962, kIndices = 34963;
/// Colours of successive fields of view, linear.
constexpr std::array<std::array<double, 3>, 4> kColors{
    {{0.02, 0.45, 0.42}, {0.75, 0.35, 0.02}, {0.25, 0.15, 0.6}, {0.6, 0.05, 0.15}}};

ordered_json array_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

ordered_json rotation_of(const Eigen::Matrix3d& rotation) {
  const Eigen::Quaterniond q(rotation);
  return {q.x(), q.y(), q.z(), q.w()};
}

class Document {
 public:
  std::size_t add_node(ordered_json node) {
    nodes_.push_back(std::move(node));
    return nodes_.size() - 1;
  }

  void add_camera(const rig::Rig::Camera& camera) {
    const schemas::Intrinsics& k = camera.model.intrinsics();
    const double width = camera.model.width(), height = camera.model.height();
    cameras_.push_back({{"type", "perspective"},
                        {"name", camera.id},
                        {"perspective",
                         {{"yfov", 2 * std::atan(height / 2 / k.fy)},
                          {"aspectRatio", width / k.fx / (height / k.fy)},
                          {"znear", 0.01}}}});
    roots_.push_back(add_node({{"name", camera.id},
                               {"camera", cameras_.size() - 1},
                               {"translation", array_of(camera.pose.position)},
                               {"rotation", rotation_of(camera.pose.world_from_camera_rotation)}}));
  }

  /// Adds a mesh; returns its node.
  std::size_t add_volume(const CoverageVolume& volume, std::size_t color) {
    const std::string name = name_of(volume);
    const std::size_t material = add_material(name, color, volume.share);
    std::vector<float> positions;
    Eigen::Vector3f least = Eigen::Vector3f::Constant(INFINITY), largest = -least;
    for (const Eigen::Vector3d& vertex : volume.surface.vertices) {
      const Eigen::Vector3f rounded = vertex.cast<float>();
      positions.insert(positions.end(), {rounded.x(), rounded.y(), rounded.z()});
      least = least.cwiseMin(rounded);
      largest = largest.cwiseMax(rounded);
    }
    std::vector<std::uint32_t> indices;
    for (const auto& triangle : volume.surface.triangles) {
      for (const int index : triangle) indices.push_back(static_cast<std::uint32_t>(index));
    }
    const std::size_t vertices = add_view(std::as_bytes(std::span(positions)), kVertices);
    accessors_.push_back({{"bufferView", vertices},
                          {"componentType", kFloat},
                          {"count", volume.surface.vertices.size()},
                          {"type", "VEC3"},
                          {"min", array_of(least.cast<double>())},
                          {"max", array_of(largest.cast<double>())}});
    const std::size_t faces = add_view(std::as_bytes(std::span(indices)), kIndices);
    accessors_.push_back({{"bufferView", faces},
                          {"componentType", kUnsignedInt},
                          {"count", indices.size()},
                          {"type", "SCALAR"}});
    meshes_.push_back({{"name", name},
                       {"primitives",
                        {{{"attributes", {{"POSITION", accessors_.size() - 2}}},
                          {"indices", accessors_.size() - 1},
                          {"material", material}}}}});
    return add_node({{"name", name}, {"mesh", meshes_.size() - 1}});
  }

  void add_root(std::size_t node) { roots_.push_back(node); }

  std::string text() const {
    ordered_json document{{"asset", {{"version", "2.0"}, {"generator", "Raystage"}}},
                          {"scene", 0},
                          {"scenes", {{{"nodes", roots_}}}},
                          {"nodes", nodes_}};
    if (!cameras_.empty()) document["cameras"] = cameras_;
    if (!meshes_.empty()) {
      document["meshes"] = meshes_;
      document["materials"] = materials_;
      document["accessors"] = accessors_;
      document["bufferViews"] = views_;
      document["buffers"] = {
          {{"byteLength", bytes_.size()},
           {"uri", "data:application/octet-stream;base64," + encode_base64(bytes_)}}};
    }
    return schemas::dump_json(document, 1) + "\n";
  }

 private:
  std::size_t add_view(std::span<const std::byte> data, int target) {
    views_.push_back({{"buffer", 0},
                      {"byteOffset", bytes_.size()},
                      {"byteLength", data.size()},
                      {"target", target}});
    bytes_.insert(bytes_.end(), data.begin(), data.end());
    return views_.size() - 1;
  }

  std::size_t add_material(const std::string& name, std::size_t color, double share) {
    const auto& rgb = kColors[color % kColors.size()];
    materials_.push_back({{"name", name},
                          {"pbrMetallicRoughness",
                           {{"baseColorFactor", {rgb[0], rgb[1], rgb[2], share == 1 ? 0.5 : 0.2}},
                            {"metallicFactor", 0},
                            {"roughnessFactor", 1}}},
                          {"alphaMode", "BLEND"},
                          {"doubleSided", true}});
    return materials_.size() - 1;
  }

  ordered_json nodes_ = ordered_json::array(), roots_ = ordered_json::array(),
               cameras_ = ordered_json::array(), meshes_ = ordered_json::array(),
               materials_ = ordered_json::array(), accessors_ = ordered_json::array(),
               views_ = ordered_json::array();
  std::vector<std::byte> bytes_;
};

}  // namespace

std::string coverage_plan_as_gltf(const CoveragePlan& plan, const rig::Rig& rig) {
  Document document;
  for (const rig::Rig::Camera& camera : rig.cameras) document.add_camera(camera);
  ordered_json volumes = ordered_json::array();
  std::size_t color = 0;
  double last_fov = plan.volumes.empty() ? 0 : plan.volumes.front().view_fov_deg;
  for (const CoverageVolume& volume : plan.volumes) {
    if (volume.view_fov_deg != last_fov) ++color;
    last_fov = volume.view_fov_deg;
    if (volume.surface.triangles.empty()) continue;
    volumes.push_back(document.add_volume(volume, color));
  }
  if (!volumes.empty()) {
    document.add_root(
        document.add_node({{"name", "range of motion"},
                           {"children", volumes},
                           {"translation", array_of(plan.array.position)},
                           {"rotation", rotation_of(plan.array.world_from_camera_rotation)}}));
  }
  return document.text();
}

}  // namespace raystage::planning
