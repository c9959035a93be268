// SPDX-License-Identifier: Apache-2.0
//
// Finds first hits and occlusions of rays (world, metres) with Embree 3, in packets of 16. Static
// parts are one Embree scene; groups of moving parts are instances whose transforms are set for
// each time. Cost: linear in the rays, logarithmic in the triangles.
#include "simulate/world.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>
#include <map>

#include "base/error.h"

namespace raystage::simulate {
namespace {

constexpr std::size_t kPacket = 16;

void check(RTCDevice device) {
  if (rtcGetDeviceError(device) != RTC_ERROR_NONE) {
    throw Error::failed("Embree could not build the scene", "scene",
                        "Free some memory and try again");
  }
}

// Commits a scene, which Embree builds with TBB. While this thread waits, it must not start work of
// another camera.
void commit(RTCScene scene) {
  tbb::this_task_arena::isolate([&] { rtcCommitScene(scene); });
}

TriangleShape shape_of(const SceneMesh& mesh, const std::array<unsigned, 3>& corners) {
  TriangleShape shape;
  for (std::size_t i = 0; i < 3; ++i) {
    shape.corner[i] = mesh.positions[corners[i]];
    shape.normal[i] = mesh.normals[corners[i]];
    shape.uv[i] = mesh.uvs[corners[i]];
  }
  const Eigen::Vector3f a = shape.corner[1] - shape.corner[0],
                        b = shape.corner[2] - shape.corner[0];
  const Eigen::Vector3f cross = a.cross(b);
  const float squared = cross.squaredNorm();
  shape.smooth = (shape.normal[0] - shape.normal[1]).norm() > 1e-4F ||
                 (shape.normal[0] - shape.normal[2]).norm() > 1e-4F;
  // Rays never hit a triangle without area, as at the pole of a sphere.
  if (!(squared > 0)) {
    shape.gradient_u = shape.gradient_v = Eigen::Vector3f::Zero();
    shape.flat_normal = shape.normal[0];
    return shape;
  }
  shape.flat_normal = cross / std::sqrt(squared);
  const Eigen::Vector3f toward_b = b.cross(cross) / squared, toward_c = cross.cross(a) / squared;
  const Eigen::Vector2f du = shape.uv[1] - shape.uv[0], dv = shape.uv[2] - shape.uv[0];
  shape.gradient_u = toward_b * du.x() + toward_c * dv.x();
  shape.gradient_v = toward_b * du.y() + toward_c * dv.y();
  return shape;
}

// Sets one ray of an Embree packet (RTCRay16, or the ray of RTCRayHit16).
template <typename Packet>
void set_ray(Packet& packet, std::size_t lane, const Ray& ray, float limit) {
  packet.org_x[lane] = ray.origin.x();
  packet.org_y[lane] = ray.origin.y();
  packet.org_z[lane] = ray.origin.z();
  packet.dir_x[lane] = ray.direction.x();
  packet.dir_y[lane] = ray.direction.y();
  packet.dir_z[lane] = ray.direction.z();
  packet.tnear[lane] = 0;
  packet.tfar[lane] = limit;
  packet.time[lane] = 0;
  packet.mask[lane] = ~0U;
  packet.flags[lane] = 0;
}

// Not RTC_INTERSECT_CONTEXT_FLAG_COHERENT: Embree 3.13.5 may loop forever if it meets instances.
RTCIntersectContext context_for_packets() {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  return context;
}

// Calls found(ray, instance, geometry, hit) for every ray. Without limits, rays are infinite.
template <typename Found>
void trace(RTCScene scene, std::span<const Ray> rays, std::span<const float> limits,
           const Found& found) {
  constexpr float kEndless = std::numeric_limits<float>::infinity();
  RTCIntersectContext context = context_for_packets();
  alignas(64) std::array<int, kPacket> valid{};
  RTCRayHit16 packet{};
  for (std::size_t first = 0; first < rays.size(); first += kPacket) {
    const std::size_t count = std::min(kPacket, rays.size() - first);
    for (std::size_t i = 0; i < kPacket; ++i) {
      valid[i] = i < count ? -1 : 0;
      const std::size_t index = first + std::min(i, count - 1);
      set_ray(packet.ray, i, rays[index], limits.empty() ? kEndless : limits[index]);
      packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    rtcIntersect16(valid.data(), scene, &context, &packet);
    for (std::size_t i = 0; i < count; ++i) {
      Hit hit;
      if (packet.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID) {
        hit.distance = packet.ray.tfar[i];
        hit.triangle = static_cast<int>(packet.hit.primID[i]);
        hit.u = packet.hit.u[i];
        hit.v = packet.hit.v[i];
      }
      found(first + i, packet.hit.instID[0][i], packet.hit.geomID[i], hit);
    }
  }
}

void test_occlusion(RTCScene scene, std::span<const Ray> rays, std::span<const float> limits,
                    std::span<std::uint8_t> occluded) {
  RTCIntersectContext context = context_for_packets();
  alignas(64) std::array<int, kPacket> valid{};
  RTCRay16 packet{};
  for (std::size_t first = 0; first < rays.size(); first += kPacket) {
    const std::size_t count = std::min(kPacket, rays.size() - first);
    for (std::size_t i = 0; i < kPacket; ++i) {
      const std::size_t index = first + std::min(i, count - 1);
      valid[i] = i < count && occluded[index] == 0 ? -1 : 0;
      set_ray(packet, i, rays[index], limits[index]);
    }
    rtcOccluded16(valid.data(), scene, &context, &packet);
    for (std::size_t i = 0; i < count; ++i) {
      if (valid[i] != 0 && packet.tfar[i] < 0) occluded[first + i] = 1;
    }
  }
}

}  // namespace

// Not with "threads=1": Embree would limit all of TBB, and thus all cameras, to one thread.
SceneGeometry::SceneGeometry(const Scene& scene) : scene_(scene), device_(rtcNewDevice(nullptr)) {
  if (!device_) {
    if (rtcGetDeviceError(nullptr) == RTC_ERROR_OUT_OF_MEMORY) throw std::bad_alloc();
    throw Error::failed("Embree cannot start on this processor", "scene",
                        "Use a machine with at least SSE4.2");
  }
  std::map<int, std::size_t> group_of_motion;
  for (int i = 0; i < static_cast<int>(scene.parts.size()); ++i) {
    const ScenePart& part = scene.parts[i];
    if (part.motion < 0) {
      static_.push_back(i);
    } else {
      assert(!part.material.mirror);
      const auto [group, is_new] = group_of_motion.emplace(part.motion, moving_.size());
      if (is_new) moving_.emplace_back();
      moving_[group->second].push_back(i);
    }
    std::vector<TriangleShape> shapes;
    for (const auto& corners : part.mesh.triangles) shapes.push_back(shape_of(part.mesh, corners));
    triangles_.push_back(std::move(shapes));
  }
  static_scene_ = make_scene(static_);
  for (const std::vector<int>& parts : moving_) moving_scenes_.push_back(make_scene(parts));
  check(device_.get());
}

SceneGeometry::Owned<RTCScene> SceneGeometry::make_scene(std::span<const int> parts) const {
  Owned<RTCScene> result(rtcNewScene(device_.get()));
  rtcSetSceneFlags(result.get(), RTC_SCENE_FLAG_ROBUST);
  for (unsigned id = 0; id < parts.size(); ++id) {
    const SceneMesh& mesh = scene_.parts[parts[id]].mesh;
    const Owned<RTCGeometry> geometry(rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE));
    void* positions =
        rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                3 * sizeof(float), mesh.positions.size());
    void* triangles =
        rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                3 * sizeof(unsigned), mesh.triangles.size());
    if (positions == nullptr || triangles == nullptr) check(device_.get());
    static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float));
    std::memcpy(positions, mesh.positions.data(), mesh.positions.size() * 3 * sizeof(float));
    std::memcpy(triangles, mesh.triangles.data(), mesh.triangles.size() * 3 * sizeof(unsigned));
    rtcCommitGeometry(geometry.get());
    rtcAttachGeometryByID(result.get(), geometry.get(), id);
  }
  commit(result.get());
  return result;
}

World::World(const SceneGeometry& geometry)
    : geometry_(geometry),
      moving_(rtcNewScene(geometry.device_.get())),
      world_from_part_(geometry.scene().parts.size(), Eigen::Isometry3f::Identity()) {
  rtcSetSceneFlags(moving_.get(), RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_DYNAMIC);
  rtcSetSceneBuildQuality(moving_.get(), RTC_BUILD_QUALITY_LOW);
  for (unsigned id = 0; id < geometry.moving_scenes_.size(); ++id) {
    SceneGeometry::Owned<RTCGeometry> instance(
        rtcNewGeometry(geometry.device_.get(), RTC_GEOMETRY_TYPE_INSTANCE));
    rtcSetGeometryInstancedScene(instance.get(), geometry.moving_scenes_[id].get());
    rtcCommitGeometry(instance.get());
    rtcAttachGeometryByID(moving_.get(), instance.get(), id);
    instances_.push_back(std::move(instance));
  }
  set_time(0);
  check(geometry.device_.get());
}

void World::set_time(double seconds) {
  const Scene& scene = geometry_.scene();
  for (std::size_t group = 0; group < instances_.size(); ++group) {
    const std::vector<int>& parts = geometry_.moving_[group];
    const int motion = scene.parts[parts[0]].motion;
    const Eigen::Isometry3f placement = scene.motions[motion](seconds);
    for (const int part : parts) world_from_part_[part] = placement;
    const Eigen::Matrix<float, 3, 4> columns = placement.matrix().topRows<3>();
    rtcSetGeometryTransform(instances_[group].get(), 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR,
                            columns.data());
    rtcCommitGeometry(instances_[group].get());
  }
  commit(moving_.get());
}

void World::trace_static(std::span<const Ray> rays, std::span<Hit> hits) const {
  const RTCScene scene = geometry_.static_scene_.get();
  trace(scene, rays, {}, [&](std::size_t ray, unsigned, unsigned geometry, const Hit& hit) {
    hits[ray] = hit;
    hits[ray].part = geometry == RTC_INVALID_GEOMETRY_ID ? -1 : geometry_.static_[geometry];
  });
}

void World::trace_moving(std::span<const Ray> rays, std::span<const float> limits,
                         std::span<Hit> hits) const {
  trace(moving_.get(), rays, limits,
        [&](std::size_t ray, unsigned instance, unsigned geometry, const Hit& hit) {
          hits[ray] = hit;
          hits[ray].part =
              geometry == RTC_INVALID_GEOMETRY_ID ? -1 : geometry_.moving_[instance][geometry];
        });
}

void World::occlude_static(std::span<const Ray> rays, std::span<const float> limits,
                           std::span<std::uint8_t> occluded) const {
  test_occlusion(geometry_.static_scene_.get(), rays, limits, occluded);
}

void World::occlude_moving(std::span<const Ray> rays, std::span<const float> limits,
                           std::span<std::uint8_t> occluded) const {
  test_occlusion(moving_.get(), rays, limits, occluded);
}

}  // namespace raystage::simulate
