// SPDX-License-Identifier: Apache-2.0
// Intersects rays with a triangle mesh by Embree, in float relative to the mesh's centre; rays
// start just in front of the mesh. Input: rays in the world, metres. Output: inverse distances in
// 1/m. Cost: O(rays x log triangles).
#include "render/lumigraph/mesh_proxy.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "base/error.h"
#include "meshes/node_transforms.h"
#include "meshes/scene_decoder.h"
#include "render/common/simd_level.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;

struct Triangles {
  std::vector<Vector3d> positions;
  std::vector<std::array<std::uint32_t, 3>> corners;
};

Triangles read_triangles(const std::filesystem::path& file) {
  const meshes::DecodedScene scene = meshes::decode_scene(file, {.applies_unit = false});
  const std::vector<Eigen::Affine3d> file_from_node = meshes::file_from_nodes(scene);
  Triangles triangles;
  for (std::size_t n = 0; n < scene.nodes.size(); ++n) {
    for (const std::uint32_t index : scene.nodes[n].meshes) {
      const meshes::DecodedScene::Mesh& mesh = scene.meshes[index];
      const auto first = static_cast<std::uint32_t>(triangles.positions.size());
      for (const auto& p : mesh.positions) {
        triangles.positions.push_back(file_from_node[n] * Vector3d(p[0], p[1], p[2]));
        if (!triangles.positions.back().allFinite()) {
          throw Error::bad_input("the mesh has a vertex that is not finite", file.string(),
                                 "Export the mesh again");
        }
      }
      for (const auto& corners : mesh.corners) {
        triangles.corners.push_back({first + corners[0], first + corners[1], first + corners[2]});
      }
    }
  }
  if (triangles.corners.empty()) {
    throw Error::bad_input("the mesh has no triangle", file.string(),
                           "Export the mesh with its faces");
  }
  return triangles;
}

}  // namespace

MeshProxy::MeshProxy(const std::filesystem::path& file)
    : device_(rtcNewDevice(embree_config().c_str())) {
  if (!device_) {
    if (rtcGetDeviceError(nullptr) == RTC_ERROR_OUT_OF_MEMORY) throw std::bad_alloc();
    throw Error::failed("Embree cannot start", file.string(), "Use a processor that it supports");
  }
  const Triangles triangles = read_triangles(file);
  Vector3d least = triangles.positions[0], most = least;
  for (const Vector3d& p : triangles.positions) {
    least = least.cwiseMin(p);
    most = most.cwiseMax(p);
  }
  centre_ = (least + most) / 2;
  radius_ = (most - least).norm() / 2;

  scene_.reset(rtcNewScene(device_.get()));
  rtcSetSceneFlags(scene_.get(), RTC_SCENE_FLAG_ROBUST);
  const Owned<RTCGeometry> geometry(rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE));
  auto* positions = static_cast<float*>(
      rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                              3 * sizeof(float), triangles.positions.size()));
  auto* corners = static_cast<std::uint32_t*>(
      rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(std::uint32_t), triangles.corners.size()));
  if (positions == nullptr || corners == nullptr) throw std::bad_alloc();
  for (const Vector3d& p : triangles.positions) {
    for (int axis = 0; axis < 3; ++axis) *positions++ = static_cast<float>(p(axis) - centre_(axis));
  }
  for (const auto& triangle : triangles.corners) corners = std::copy_n(triangle.data(), 3, corners);
  rtcCommitGeometry(geometry.get());
  rtcAttachGeometry(scene_.get(), geometry.get());
  // Embree builds with TBB: while it waits, this thread must not start other tasks.
  tbb::this_task_arena::isolate([&] { rtcCommitScene(scene_.get()); });
  if (rtcGetDeviceError(device_.get()) != RTC_ERROR_NONE) {
    throw Error::failed("Embree could not build the mesh", file.string(),
                        "Free some memory and try again");
  }
  constexpr std::size_t kTreePerTriangle = 100;  // bytes; Embree's manual, robust scenes
  bytes_ = triangles.positions.size() * 12 + triangles.corners.size() * (12 + kTreePerTriangle);
}

void MeshProxy::intersect(std::span<const WorldRay> rays, std::span<double> inverse_distance,
                          const RaySurface& beyond) const {
  constexpr std::size_t kPacket = 16;
  beyond(rays, inverse_distance);
  for (std::size_t begin = 0; begin < rays.size(); begin += kPacket) {
    const std::size_t n = std::min(kPacket, rays.size() - begin);
    alignas(64) RTCRayHit16 packet{};
    alignas(64) int valid[kPacket] = {};
    double skipped[kPacket] = {};
    for (std::size_t i = 0; i < n; ++i) {
      // Start just in front of the mesh: float is precise there, whatever the eye's distance.
      const WorldRay& ray = rays[begin + i];
      const Vector3d to_centre = centre_ - ray.origin;
      skipped[i] = std::max(0.0, to_centre.dot(ray.direction) - 1.01 * radius_);
      const Vector3d start = skipped[i] * ray.direction - to_centre;
      valid[i] = -1;
      packet.ray.org_x[i] = static_cast<float>(start.x());
      packet.ray.org_y[i] = static_cast<float>(start.y());
      packet.ray.org_z[i] = static_cast<float>(start.z());
      packet.ray.dir_x[i] = static_cast<float>(ray.direction.x());
      packet.ray.dir_y[i] = static_cast<float>(ray.direction.y());
      packet.ray.dir_z[i] = static_cast<float>(ray.direction.z());
      packet.ray.tfar[i] = std::numeric_limits<float>::infinity();
      packet.ray.mask[i] = ~0U;
      packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect16(valid, scene_.get(), &context, &packet);
    for (std::size_t i = 0; i < n; ++i) {
      if (packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
      const double distance = skipped[i] + double{packet.ray.tfar[i]};
      if (distance > 0) inverse_distance[begin + i] = 1 / distance;
    }
  }
}

}  // namespace raystage::render
