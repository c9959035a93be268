// SPDX-License-Identifier: Apache-2.0
// Reads how the nodes of a glTF file move. Assimp reads the meshes and numbers nodes depth-first,
// with a root of its own above a scene of several roots; the same order here assigns the
// transforms. Input: bytes of a .gltf or .glb file. Output: transforms of all nodes, coordinates of
// the file, as a function of the time in seconds. Cost per time: nodes x log keys.
#include "compose/geometry/mesh_animation.h"

#include <fmt/format.h>

#include <memory>
#include <set>
#include <utility>

#include "compose/camera/gltf_animation.h"
#include "compose/camera/gltf_file.h"

namespace raystage::compose {
namespace {

using Eigen::Matrix4d;
using nlohmann::json;

constexpr int kNone = -1;

/// A node with its parent, both by their index in depth-first order.
struct PlacedNode {
  GltfNode node;
  int parent = kNone;
};

const json& list_of(const GltfFile& file, const json& object, const char* key,
                    const std::string& where) {
  static const json kEmpty = json::array();
  const auto at = object.find(key);
  if (at == object.end()) return kEmpty;
  if (!at->is_array()) throw file.input_error("found no list", where + "/" + key);
  return *at;
}

class NodeReader {
 public:
  NodeReader(const GltfFile& file, std::span<const std::string> names)
      : file_(file), names_(names) {}

  std::vector<PlacedNode> read() {
    if (file_.count("scenes") == 0) throw mismatch("/scenes");
    const json index_of_scene = file_.document().value("scene", json(std::size_t{0}));
    const json& scene = file_.element("scenes", index_of_scene);
    const json& roots =
        list_of(file_, scene, "nodes", fmt::format("/scenes/{}", index_of_scene.dump()));
    int root = kNone;
    if (roots.size() != 1) {
      root = 0;
      placed_.emplace_back();
    }
    // A stack instead of a recursion: the file states how deep it is.
    std::vector<std::pair<json, int>> left;
    const auto push_reversed = [&](const json& children, int parent) {
      for (auto child = children.rbegin(); child != children.rend(); ++child) {
        left.emplace_back(*child, parent);
      }
    };
    push_reversed(roots, root);
    while (!left.empty()) {
      const auto [index, parent] = left.back();
      left.pop_back();
      const json& node = file_.element("nodes", index);
      const auto at = placed_.size();
      const std::string name = gltf_text(node, "name");
      // Nodes have one parent, so that there are no more places than nodes.
      if (at > file_.count("nodes")) throw mismatch("/nodes");
      const bool is_checked = !names_.empty();
      if (is_checked && (at >= names_.size() || (!name.empty() && name != names_[at]))) {
        throw mismatch("/nodes");
      }
      placed_.push_back({read_gltf_node(file_, index.get<std::size_t>()), parent});
      push_reversed(
          list_of(file_, node, "children", fmt::format("/nodes/{}", index.get<std::size_t>())),
          static_cast<int>(at));
    }
    if (!names_.empty() && placed_.size() != names_.size()) throw mismatch("/nodes");
    return std::move(placed_);
  }

 private:
  Error mismatch(const char* where) const {
    return file_.input_error("the animated nodes are not those that have the meshes", where,
                             "Export the file again with one scene, or write \"animated\": false");
  }

  const GltfFile& file_;
  std::span<const std::string> names_;
  std::vector<PlacedNode> placed_;
};

}  // namespace

std::optional<MeshAnimation> parse_mesh_animation(std::string_view bytes,
                                                  const std::filesystem::path& path,
                                                  const GltfFrameRate& rate,
                                                  std::span<const std::string> node_names,
                                                  std::span<const std::size_t> mesh_nodes) {
  const GltfFile file(bytes, path);
  if (file.count("animations") == 0) return std::nullopt;
  const auto nodes =
      std::make_shared<const std::vector<PlacedNode>>(NodeReader(file, node_names).read());
  std::set<std::string> wanted;
  for (const std::size_t of_mesh : mesh_nodes) {
    if (of_mesh >= nodes->size()) continue;
    for (int i = static_cast<int>(of_mesh); i != kNone; i = (*nodes)[i].parent) {
      const GltfNode& node = (*nodes)[i].node;
      if (node.path.empty()) continue;
      if (wanted.contains(node.path + "/scale")) break;  // its ancestors are known, too
      node.add_targets(wanted);
    }
  }
  MeshAnimation animation;
  animation.timing = read_gltf_timing(file, rate);
  const auto samplers = std::make_shared<const GltfSamplers>(
      read_gltf_samplers(file, wanted, animation.timing.frame_rate));
  if (samplers->empty()) return std::nullopt;
  animation.key_seconds = key_seconds_of(*samplers);
  animation.file_from_node = [nodes, samplers](double seconds) {
    std::vector<Eigen::Affine3d> file_from_node;
    file_from_node.reserve(nodes->size());
    for (const PlacedNode& placed : *nodes) {
      Eigen::Affine3d transform = Eigen::Affine3d::Identity();
      if (!placed.node.path.empty()) {
        transform = Eigen::Affine3d(placed.node.parent_from_node(seconds, *samplers));
      }
      if (placed.parent != kNone) transform = file_from_node[placed.parent] * transform;
      file_from_node.push_back(transform);
    }
    return file_from_node;
  };
  return animation;
}

}  // namespace raystage::compose
