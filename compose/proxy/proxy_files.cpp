// SPDX-License-Identifier: Apache-2.0
#include "compose/proxy/proxy_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <nlohmann/json.hpp>
#include <vector>

#include "store/jpeg/encode.h"

namespace raystage::compose {
namespace {

using nlohmann::ordered_json;

static_assert(std::endian::native == std::endian::little, "both formats are little-endian");

template <class T>
void append_value(std::string& bytes, const T& value) {
  const std::size_t at = bytes.size();
  bytes.resize(at + sizeof(T));
  std::memcpy(bytes.data() + at, &value, sizeof(T));
}

constexpr int kFloat = 5126, kUnsignedInt = 5125, kVertices = 34962, kIndices = 34963;

/// The binary part of a GLB file, with the views that describe it.
struct GlbBuffer {
  std::string bytes;
  ordered_json views = ordered_json::array();

  /// Adds data as a buffer view. Returns its index. `target`: 0 for none.
  std::size_t add(std::string_view data, int target) {
    ordered_json view{{"buffer", 0}, {"byteOffset", bytes.size()}, {"byteLength", data.size()}};
    if (target != 0) view["target"] = target;
    views.push_back(view);
    bytes += data;
    bytes.resize((bytes.size() + 3) / 4 * 4, '\0');
    return views.size() - 1;
  }
};

void append_chunk(std::string& file, std::string_view type, std::string data, char padding) {
  data.resize((data.size() + 3) / 4 * 4, padding);
  append_value(file, static_cast<std::uint32_t>(data.size()));
  file += type;
  file += data;
}

ordered_json unlit_material() {
  return {{"pbrMetallicRoughness",
           {{"baseColorTexture", {{"index", 0}}}, {"metallicFactor", 0}, {"roughnessFactor", 1}}},
          {"doubleSided", true},
          {"extensions", {{"KHR_materials_unlit", ordered_json::object()}}}};
}

}  // namespace

std::string format_ply(const PointCloud& cloud) {
  const bool is_near = cloud.origin.isZero(0);
  std::string bytes = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment Raystage: metres, y up\n"
      "element vertex {0}\nproperty {1} x\nproperty {1} y\nproperty {1} z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
      cloud.points.size(), is_near ? "float" : "double");
  for (const ProxyPoint& point : cloud.points) {
    if (is_near) {
      for (const float value : point.position) append_value(bytes, value);
    } else {
      const Eigen::Vector3d in_world = cloud.origin + point.position.cast<double>();
      for (const double value : in_world) append_value(bytes, value);
    }
    for (const std::uint8_t code : point.color) append_value(bytes, code);
  }
  return bytes;
}

std::string format_glb(const ProxyMesh& mesh, const std::string& name) {
  std::string positions, coordinates, indices;
  Eigen::Vector3f least = Eigen::Vector3f::Zero(), most = Eigen::Vector3f::Zero();
  if (!mesh.positions.empty()) least = most = mesh.positions.front();
  for (const Eigen::Vector3f& position : mesh.positions) {
    for (const float value : position) append_value(positions, value);
    least = least.cwiseMin(position);
    most = most.cwiseMax(position);
  }
  for (const Eigen::Vector2f& coordinate : mesh.texture_coordinates) {
    for (const float value : coordinate) append_value(coordinates, value);
  }
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t index : triangle) append_value(indices, index);
  }
  const auto jpeg = store::encode_jpeg(mesh.texture, {.quality = 90, .restart_interval = 0});

  GlbBuffer buffer;
  ordered_json document{{"asset", {{"version", "2.0"}, {"generator", "Raystage"}}},
                        {"extensionsUsed", {"KHR_materials_unlit"}},
                        {"scene", 0},
                        {"scenes", {{{"nodes", {0}}}}},
                        {"nodes", {{{"name", name}, {"mesh", 0}}}}};
  const auto vector_of = [](const auto& v) { return ordered_json{v.x(), v.y(), v.z()}; };
  if (!mesh.origin.isZero(0)) document["nodes"][0]["translation"] = vector_of(mesh.origin);
  document["accessors"] = {{{"bufferView", buffer.add(positions, kVertices)},
                            {"componentType", kFloat},
                            {"count", mesh.positions.size()},
                            {"type", "VEC3"},
                            {"min", vector_of(least)},
                            {"max", vector_of(most)}},
                           {{"bufferView", buffer.add(coordinates, kVertices)},
                            {"componentType", kFloat},
                            {"count", mesh.positions.size()},
                            {"type", "VEC2"}},
                           {{"bufferView", buffer.add(indices, kIndices)},
                            {"componentType", kUnsignedInt},
                            {"count", 3 * mesh.triangles.size()},
                            {"type", "SCALAR"}}};
  const std::string_view picture(reinterpret_cast<const char*>(jpeg.data()), jpeg.size());
  document["images"] = {{{"bufferView", buffer.add(picture, 0)}, {"mimeType", "image/jpeg"}}};
  document["textures"] = {{{"source", 0}}};
  document["materials"] = {unlit_material()};
  document["meshes"] = {{{"name", name},
                         {"primitives",
                          {{{"attributes", {{"POSITION", 0}, {"TEXCOORD_0", 1}}},
                            {"indices", 2},
                            {"material", 0}}}}}};
  document["bufferViews"] = buffer.views;
  document["buffers"] = {{{"byteLength", buffer.bytes.size()}}};

  std::string chunks;
  append_chunk(chunks, "JSON", document.dump(), ' ');
  append_chunk(chunks, std::string_view("BIN\0", 4), std::move(buffer.bytes), '\0');
  constexpr std::uint32_t kVersion = 2, kHeaderBytes = 12;
  std::string file = "glTF";
  append_value(file, kVersion);
  append_value(file, static_cast<std::uint32_t>(kHeaderBytes + chunks.size()));
  return file + chunks;
}

}  // namespace raystage::compose
