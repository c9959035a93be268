// SPDX-License-Identifier: Apache-2.0
// Interpolates the surface at a ray's hit: shading normal by barycentric coordinates, colour by the
// material's texture. The texture filter is isotropic. Its width is the ray's footprint (spread
// times path length, over the cosine of incidence, at least 0.1) times the texture widths per
// metre. Input: a hit on one triangle; ray and result in world coordinates, metres. Cost: constant,
// with one texture lookup.
#include "compose/geometry/surface_point.h"

#include <algorithm>
#include <cmath>

namespace raystage::compose {
namespace {

using Eigen::Vector3d;

/// Returns the texture widths per metre on a triangle, from two edges in the texture and the world.
float texture_per_metre(const Eigen::Vector2f& uv1, const Eigen::Vector2f& uv2,
                        const Vector3d& edge1, const Vector3d& edge2) {
  const double in_texture = std::abs(double{uv1.x()} * uv2.y() - double{uv1.y()} * uv2.x());
  const double in_world = edge1.cross(edge2).norm();
  return in_world > 0 ? static_cast<float>(std::sqrt(in_texture / in_world)) : 0.0F;
}

}  // namespace

SurfacePoint surface_point_at(const MeshInstance& mesh, const Textures* textures,
                              const render::WorldRay& ray, const SurfaceHit& hit, double spread,
                              double distance) {
  const Mesh& m = mesh.scene->mesh();
  const auto& corner = m.corners[hit.triangle];
  const Eigen::Matrix3d linear = mesh.world_from_object.linear();
  const Vector3d edge1 = linear * (m.positions[corner[1]] - m.positions[corner[0]]);
  const Vector3d edge2 = linear * (m.positions[corner[2]] - m.positions[corner[0]]);
  SurfacePoint point;
  point.position = ray.origin + hit.distance * ray.direction;
  point.geometric_normal = edge1.cross(edge2).stableNormalized();
  if (!(point.geometric_normal.dot(ray.direction) < 0))
    point.geometric_normal = -point.geometric_normal;
  point.normal = point.geometric_normal;
  const float w = 1 - hit.u - hit.v;
  if (!m.normals.empty()) {
    const Eigen::Vector3f blended =
        w * m.normals[corner[0]] + hit.u * m.normals[corner[1]] + hit.v * m.normals[corner[2]];
    // Normals transform by the inverse transpose.
    const Vector3d normal =
        (mesh.object_from_world.linear().transpose() * blended.cast<double>()).stableNormalized();
    if (normal.allFinite() && normal.squaredNorm() > 0.5) {
      point.normal = normal.dot(point.geometric_normal) < 0 ? Vector3d(-normal) : normal;
    }
  }
  point.object = m.triangle_objects[hit.triangle];
  const auto material = static_cast<std::size_t>(m.objects[point.object].material);
  point.material = &m.materials[material];
  point.color = point.material->color;
  const Textures::Handle texture =
      textures != nullptr && !mesh.textures.empty() ? mesh.textures[material] : nullptr;
  if (texture == nullptr || m.uvs.empty()) return point;
  const Eigen::Vector2f uv0 = m.uvs[corner[0]];
  const Eigen::Vector2f uv1 = m.uvs[corner[1]] - uv0, uv2 = m.uvs[corner[2]] - uv0;
  const Eigen::Vector2f uv = uv0 + hit.u * uv1 + hit.v * uv2;
  const double slant = std::max(-point.geometric_normal.dot(ray.direction), 0.1);
  const auto width = static_cast<float>(spread * (distance + hit.distance) / slant);
  point.color = point.color.cwiseProduct(textures->color(
      texture, uv.x(), uv.y(), std::min(width * texture_per_metre(uv1, uv2, edge1, edge2), 1.0F)));
  return point;
}

}  // namespace raystage::compose
