// SPDX-License-Identifier: Apache-2.0
// Converts rays and cameras to the floats of the lumigraph kernels (ray_chunk_kernels.cpp),
// relative to the centre of the rig. Input: rays in the world (metres) and inverse distances (1/m),
// in double. Output: RayChunk, ChunkCamera. Cost: O(rays), O(cameras).
#include "render/lumigraph/ray_chunk.h"

#include <algorithm>
#include <limits>

#include "render/sampling/depth_sampling.h"

namespace raystage::render {
void fill_chunk(std::span<const WorldRay> rays, std::span<const double> inverse_distance,
                const Eigen::Vector3d& middle, RayChunk& chunk) {
  chunk.count = static_cast<int>(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Eigen::Vector3d& direction = rays[i].direction;
    const Eigen::Vector3d from_middle = rays[i].origin - middle;
    const double eye = from_middle.dot(direction), inverse = inverse_distance[i];
    const Eigen::Vector3d base = from_middle - eye * direction;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<Eigen::Index>(axis);
      chunk.base[axis][i] = static_cast<float>(base(a));
      chunk.direction[axis][i] = static_cast<float>(direction(a));
    }
    chunk.eye[i] = static_cast<float>(eye);
    chunk.inverse_distance[i] = static_cast<float>(inverse);
    chunk.point[i] = static_cast<float>(1 + eye * inverse);
  }
  std::fill(chunk.inverse_distance.begin() + chunk.count, chunk.inverse_distance.end(),
            std::numeric_limits<float>::quiet_NaN());
}

std::vector<ChunkCamera> chunk_cameras(const rig::Rig& rig) {
  std::vector<ChunkCamera> cameras;
  const Eigen::Vector3d middle = rig.centre();
  for (const rig::Rig::Camera& camera : rig.cameras) {
    ChunkCamera of_chunk;
    of_chunk.camera = static_cast<int>(cameras.size());
    of_chunk.lens = depth_source({}, camera).camera;  // only the lens is used, so any view will do
    const Eigen::Vector3d centre = camera.pose.position - middle;
    const Eigen::Matrix3d rotation = camera.pose.world_from_camera_rotation.transpose();
    for (int r = 0; r < 3; ++r) {
      of_chunk.centre[r] = static_cast<float>(centre(r));
      for (int c = 0; c < 3; ++c) {
        of_chunk.camera_from_world[3 * r + c] = static_cast<float>(rotation(r, c));
      }
    }
    cameras.push_back(of_chunk);
  }
  return cameras;
}

ChunkWeightOptions::ChunkWeightOptions(const RayWeightOptions& weighing, double spacing)
    : cameras(weighing.cameras),
      angular(static_cast<float>(weighing.angular)),
      resolution(static_cast<float>(weighing.resolution)),
      field_of_view(static_cast<float>(weighing.field_of_view * spacing)),
      border(static_cast<float>(weighing.border)),
      least(static_cast<float>(kMinPenalty * spacing)) {}

}  // namespace raystage::render
