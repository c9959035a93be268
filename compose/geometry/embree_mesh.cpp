// SPDX-License-Identifier: Apache-2.0
// Traces world rays against one mesh with Embree, in packets of 16. Embree computes in float. Rays
// are therefore transformed to object coordinates around the mesh's centre and start just before
// its bounding sphere: precision does not depend on the distance of the camera. Rays that miss the
// sphere are not traced. Input: rays in world coordinates, metres; output: distances along them,
// metres. Cost: O(log triangles) per ray near the mesh.
#include "compose/geometry/embree_mesh.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <new>

#include "base/error.h"
#include "render/common/simd_level.h"

namespace raystage::compose {

using Eigen::Vector3d;

namespace {

RTCIntersectContext context_of(RayCoherence order) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  if (order == RayCoherence::kCoherent) context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  return context;
}

}  // namespace

EmbreeMesh::EmbreeMesh(Mesh mesh, std::string name)
    : mesh_(std::move(mesh)), name_(std::move(name)) {
  Vector3d least = mesh_.positions.front(), most = least;
  for (const Vector3d& p : mesh_.positions) {
    least = least.cwiseMin(p);
    most = most.cwiseMax(p);
  }
  centre_ = (least + most) / 2;
  radius_ = (most - least).norm() / 2;
  constexpr std::size_t kBvhBytesPerTriangle = 100;  // Embree's manual, robust scenes
  bytes_ = mesh_.bytes() + mesh_.positions.size() * 12 +
           mesh_.corners.size() * (12 + kBvhBytesPerTriangle);
}

void EmbreeMesh::build_bvh() const {
  std::call_once(built_, [this] { build(); });
}

void EmbreeMesh::build() const {
  device_.reset(rtcNewDevice(render::embree_config().c_str()));
  if (!device_) {
    if (rtcGetDeviceError(nullptr) == RTC_ERROR_OUT_OF_MEMORY) throw std::bad_alloc();
    throw Error::failed("Embree cannot start", name_, "Use a processor that it supports");
  }
  scene_.reset(rtcNewScene(device_.get()));
  rtcSetSceneFlags(scene_.get(), RTC_SCENE_FLAG_ROBUST);
  const Owned<RTCGeometry> geometry(rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE));
  auto* positions = static_cast<float*>(
      rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                              3 * sizeof(float), mesh_.positions.size()));
  auto* corners = static_cast<std::uint32_t*>(
      rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(std::uint32_t), mesh_.corners.size()));
  if (positions == nullptr || corners == nullptr) throw std::bad_alloc();
  for (const Vector3d& p : mesh_.positions) {
    for (int axis = 0; axis < 3; ++axis) *positions++ = static_cast<float>(p(axis) - centre_(axis));
  }
  for (const auto& triangle : mesh_.corners) corners = std::copy_n(triangle.data(), 3, corners);
  rtcCommitGeometry(geometry.get());
  rtcAttachGeometry(scene_.get(), geometry.get());
  // Isolated: Embree builds with TBB, and this thread must not start other work meanwhile.
  tbb::this_task_arena::isolate([&] { rtcCommitScene(scene_.get()); });
  const RTCError error = rtcGetDeviceError(device_.get());
  if (error == RTC_ERROR_OUT_OF_MEMORY) throw std::bad_alloc();
  if (error != RTC_ERROR_NONE) {
    throw Error::failed("Embree rejected the mesh", name_, "Check the triangles of the mesh");
  }
  is_built_.store(true, std::memory_order_release);
}

bool EmbreeMesh::fill(const Eigen::Affine3d& object_from_world,
                      std::span<const render::WorldRay> rays, double min_distance,
                      std::span<const double> max_distance, Packet& packet) const {
  RTCRay16& of_embree = packet.rays.ray;
  bool any = false;
  for (std::size_t i = 0; i < kPacket; ++i) {
    packet.valid[i] = 0;
    if (i >= rays.size()) continue;
    const render::WorldRay& ray = rays[i];
    // Units of the file from here on.
    const Vector3d along = object_from_world.linear() * ray.direction;
    packet.per_metre[i] = along.norm();
    if (!(packet.per_metre[i] > 0) || !std::isfinite(packet.per_metre[i])) continue;
    const Vector3d direction = along / packet.per_metre[i];
    const Vector3d to_centre = centre_ - object_from_world * ray.origin;
    const double closest = to_centre.dot(direction);
    const double off2 = (to_centre - closest * direction).squaredNorm();
    if (!(off2 <= 1.002 * radius_ * radius_)) continue;
    packet.start[i] = std::max(min_distance * packet.per_metre[i], closest - 1.01 * radius_);
    const double end = std::min(max_distance[i] * packet.per_metre[i], closest + 1.01 * radius_);
    if (!(end > packet.start[i])) continue;
    const Vector3d origin = packet.start[i] * direction - to_centre;
    any = true;
    packet.valid[i] = -1;
    of_embree.org_x[i] = static_cast<float>(origin.x());
    of_embree.org_y[i] = static_cast<float>(origin.y());
    of_embree.org_z[i] = static_cast<float>(origin.z());
    of_embree.dir_x[i] = static_cast<float>(direction.x());
    of_embree.dir_y[i] = static_cast<float>(direction.y());
    of_embree.dir_z[i] = static_cast<float>(direction.z());
    of_embree.tnear[i] = 0;
    of_embree.time[i] = 0;
    of_embree.flags[i] = 0;
    of_embree.tfar[i] = static_cast<float>(end - packet.start[i]);
    of_embree.mask[i] = ~0U;
    packet.rays.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    packet.rays.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  return any;
}

void EmbreeMesh::intersect(const Eigen::Affine3d& object_from_world,
                           std::span<const render::WorldRay> rays, double min_distance,
                           std::span<SurfaceHit> hits, RayCoherence order) const {
  Packet packet;
  std::array<double, kPacket> to{};
  for (std::size_t begin = 0; begin < rays.size(); begin += kPacket) {
    const std::size_t n = std::min(kPacket, rays.size() - begin);
    for (std::size_t i = 0; i < n; ++i) to[i] = hits[begin + i].distance;
    if (!fill(object_from_world, rays.subspan(begin, n), min_distance, to, packet)) continue;
    build_bvh();
    RTCIntersectContext context = context_of(order);
    rtcIntersect16(packet.valid.data(), scene_.get(), &context, &packet.rays);
    for (std::size_t i = 0; i < n; ++i) {
      if (packet.valid[i] == 0 || packet.rays.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
      SurfaceHit& hit = hits[begin + i];
      const double distance =
          (packet.start[i] + double{packet.rays.ray.tfar[i]}) / packet.per_metre[i];
      if (distance >= hit.distance) continue;
      hit = {distance, packet.rays.hit.primID[i], packet.rays.hit.u[i], packet.rays.hit.v[i]};
    }
  }
}

void EmbreeMesh::occlude(const Eigen::Affine3d& object_from_world,
                         std::span<const render::WorldRay> rays, double min_distance,
                         std::span<const double> max_distance, std::span<std::uint8_t> occluded,
                         RayCoherence order) const {
  Packet packet;
  std::array<double, kPacket> to{};
  for (std::size_t begin = 0; begin < rays.size(); begin += kPacket) {
    const std::size_t n = std::min(kPacket, rays.size() - begin);
    // An empty interval skips rays that are already occluded.
    for (std::size_t i = 0; i < n; ++i)
      to[i] = occluded[begin + i] != 0 ? 0 : max_distance[begin + i];
    if (!fill(object_from_world, rays.subspan(begin, n), min_distance, to, packet)) continue;
    build_bvh();
    RTCIntersectContext context = context_of(order);
    rtcOccluded16(packet.valid.data(), scene_.get(), &context, &packet.rays.ray);
    for (std::size_t i = 0; i < n; ++i) {
      if (packet.valid[i] != 0 && packet.rays.ray.tfar[i] < 0) occluded[begin + i] = 1;
    }
  }
}

}  // namespace raystage::compose
