// SPDX-License-Identifier: Apache-2.0
#include "compose/geometry/mesh_scene.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>

#include "schemas/error.h"

namespace raystage {

using Eigen::Vector3d;

MeshScene::MeshScene(Mesh mesh, const std::string& name) : mesh_(std::move(mesh)) {
  device_.reset(rtcNewDevice(nullptr));
  if (!device_) throw Error::failed("Embree does not start", name, "Check the processor");
  Vector3d least = mesh_.positions.front(), most = least;
  for (const Vector3d& p : mesh_.positions) {
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
                              3 * sizeof(float), mesh_.positions.size()));
  auto* corners = static_cast<std::uint32_t*>(
      rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(std::uint32_t), mesh_.corners.size()));
  if (positions == nullptr || corners == nullptr) {
    throw Error::failed("Embree has no memory for the mesh", name, "Free some and try again");
  }
  for (const Vector3d& p : mesh_.positions) {
    for (int axis = 0; axis < 3; ++axis) *positions++ = static_cast<float>(p(axis) - centre_(axis));
  }
  for (const auto& triangle : mesh_.corners) corners = std::copy_n(triangle.data(), 3, corners);
  rtcCommitGeometry(geometry.get());
  rtcAttachGeometry(scene_.get(), geometry.get());
  // Embree builds with TBB: while it waits, this thread must not take up other work.
  tbb::this_task_arena::isolate([&] { rtcCommitScene(scene_.get()); });
  if (rtcGetDeviceError(device_.get()) != RTC_ERROR_NONE) {
    throw Error::failed("Embree could not take in the mesh", name,
                        "Free some memory and try again");
  }
  constexpr std::size_t kTreePerTriangle = 100;  // bytes; Embree's manual, robust scenes
  bytes_ =
      mesh_.bytes() + mesh_.positions.size() * 12 + mesh_.corners.size() * (12 + kTreePerTriangle);
}

void MeshScene::meet(const Eigen::Affine3d& object_from_world, std::span<const WorldRay> rays,
                     double from_distance, std::span<SurfaceHit> hits) const {
  constexpr std::size_t kPacket = 16;
  for (std::size_t begin = 0; begin < rays.size(); begin += kPacket) {
    const std::size_t n = std::min(kPacket, rays.size() - begin);
    alignas(64) RTCRayHit16 packet{};
    alignas(64) int valid[kPacket] = {};
    double start[kPacket] = {}, per_metre[kPacket] = {};
    bool any = false;
    for (std::size_t i = 0; i < n; ++i) {
      const WorldRay& ray = rays[begin + i];
      // Units of the file from here on, and from just before the mesh: float counts from there,
      // however far the eye.
      const Vector3d along = object_from_world.linear() * ray.direction;
      per_metre[i] = along.norm();
      if (!(per_metre[i] > 0) || !std::isfinite(per_metre[i])) continue;
      const Vector3d direction = along / per_metre[i];
      const Vector3d to_centre = centre_ - object_from_world * ray.origin;
      const double closest = to_centre.dot(direction);
      const double off = (to_centre - closest * direction).norm();
      if (!(off <= 1.001 * radius_)) continue;
      start[i] = std::max(from_distance * per_metre[i], closest - 1.01 * radius_);
      const double end =
          std::min(hits[begin + i].distance * per_metre[i], closest + 1.01 * radius_);
      if (!(end > start[i])) continue;
      const Vector3d origin = start[i] * direction - to_centre;
      any = true;
      valid[i] = -1;
      packet.ray.org_x[i] = static_cast<float>(origin.x());
      packet.ray.org_y[i] = static_cast<float>(origin.y());
      packet.ray.org_z[i] = static_cast<float>(origin.z());
      packet.ray.dir_x[i] = static_cast<float>(direction.x());
      packet.ray.dir_y[i] = static_cast<float>(direction.y());
      packet.ray.dir_z[i] = static_cast<float>(direction.z());
      packet.ray.tfar[i] = static_cast<float>(end - start[i]);
      packet.ray.mask[i] = ~0U;
      packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    if (!any) continue;
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect16(valid, scene_.get(), &context, &packet);
    for (std::size_t i = 0; i < n; ++i) {
      if (valid[i] == 0 || packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
      SurfaceHit& hit = hits[begin + i];
      const double distance = (start[i] + double{packet.ray.tfar[i]}) / per_metre[i];
      if (distance >= hit.distance) continue;
      hit = {distance, packet.hit.primID[i], packet.hit.u[i], packet.hit.v[i]};
    }
  }
}

}  // namespace raystage
