// SPDX-License-Identifier: Apache-2.0
//
// Computes the light along rays through a scene with one point light, hard shadows, a sky and
// ground term, highlights and mirrors (one reflection). Static parts are traced once
// (sample_static) and combined with the moving parts at each time (sample). Textures are filtered
// over the footprint of a ray; shadow rays start on the smooth surface (Hanika, "Hacking the
// shadow terminator", 2021). Input: rays in the world, metres. Output: linear light, full scale
// 1. The cost grows with the number of rays.
#include "simulate/radiance_sampler.h"

#include <algorithm>

namespace raystage::simulate {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

// Distance in metres between a surface and the start of its shadow rays: no part is thinner.
constexpr float kShadowOffset = 1e-3F;

struct SurfacePoint {
  Vector3f position;       // world
  Vector3f normal, flat;   // world, unit, towards the ray
  Vector3f shadow_origin;  // world
  Vector3f albedo;
};

// Returns the point where a ray hits a triangle, with its filtered texture. `travelled`: metres
// from the camera, including the path to a mirror.
SurfacePoint surface_at(const World& world, const Ray& ray, const Hit& hit, float travelled,
                        float footprint) {
  const Scene& scene = world.geometry().scene();
  const ScenePart& part = scene.parts[hit.part];
  const TriangleShape& shape = world.geometry().triangle(hit.part, hit.triangle);
  const Eigen::Isometry3f& world_from_part = world.world_from_part(hit.part);
  const Eigen::Matrix3f rotation = world_from_part.linear();
  const float w = 1 - hit.u - hit.v;

  SurfacePoint point;
  const Vector3f in_part = shape.corner[0] * w + shape.corner[1] * hit.u + shape.corner[2] * hit.v;
  const Vector3f direction_in_part = rotation.transpose() * ray.direction;
  Vector3f flat = shape.flat_normal;
  Vector3f normal = flat;
  float side = direction_in_part.dot(flat) > 0 ? -1.0F : 1.0F;
  Vector3f lifted = in_part;
  if (shape.smooth) {
    normal = (shape.normal[0] * w + shape.normal[1] * hit.u + shape.normal[2] * hit.v).normalized();
    if (normal.dot(flat) < 0) normal = -normal;
    // On the smooth surface, as triangles shadow each other at the terminator (Hanika 2021).
    const float weight[3] = {w, hit.u, hit.v};
    for (int i = 0; i < 3; ++i) {
      const Vector3f outward =
          shape.normal[i].dot(flat) < 0 ? Vector3f(-shape.normal[i]) : shape.normal[i];
      const float below = side * std::min(0.0F, side * (in_part - shape.corner[i]).dot(outward));
      lifted -= weight[i] * below * outward;
    }
  }
  flat *= side;
  normal *= side;
  point.position = world_from_part * in_part;
  point.flat = rotation * flat;
  point.normal = rotation * normal;
  point.shadow_origin = world_from_part * lifted + kShadowOffset * point.flat;

  point.albedo = part.material.colour;
  if (part.material.texture >= 0) {
    const Texture& texture = scene.textures[part.material.texture];
    const Vector2f uv = shape.uv[0] * w + shape.uv[1] * hit.u + shape.uv[2] * hit.v;
    // The footprint is a disc perpendicular to the ray; its projection is stretched by 1 / cosine.
    const float width = footprint * travelled;
    const float cosine = std::max(0.05F, -direction_in_part.dot(flat));
    const Vector3f along = direction_in_part + flat * cosine;
    const float length = along.norm();
    const Vector3f major = length > 1e-4F ? Vector3f(along / length) : flat.unitOrthogonal();
    const Vector3f minor = flat.cross(major);
    const auto in_texture = [&](const Vector3f& axis) {
      return Vector2f(shape.gradient_u.dot(axis), shape.gradient_v.dot(axis));
    };
    const Vector3f texel =
        texture.sample(uv, in_texture(major) * (width / cosine), in_texture(minor) * width);
    point.albedo = point.albedo.cwiseProduct(texel);
  }
  return point;
}

// The light that a surface sends along a ray: `unlit` always, and `lamp` where the lamp is visible
// (0 where the surface faces away).
struct Shade {
  Vector3f unlit, lamp, shadow_origin, normal;
};

Shade shade(const World& world, const Ray& ray, const Hit& hit, float travelled, float footprint,
            const Vector3f& tint) {
  const Scene& scene = world.geometry().scene();
  const SceneMaterial& material = scene.parts[hit.part].material;
  const SurfacePoint point = surface_at(world, ray, hit, travelled, footprint);
  const Vector3f albedo = tint.cwiseProduct(point.albedo);
  const Vector3f fill = scene.ground_colour +
                        (scene.sky_colour - scene.ground_colour) * (0.5F + 0.5F * point.normal.y());
  Shade result{albedo.cwiseProduct(fill) + albedo * material.emission, Vector3f::Zero(),
               point.shadow_origin, point.normal};
  const Vector3f direction = (scene.light_position - point.shadow_origin).normalized();
  const float facing = point.normal.dot(direction);
  if (facing <= 0 || point.flat.dot(direction) <= 0 || material.emission > 0) return result;
  Vector3f reflectance = albedo;
  if (material.specular > 0) {
    const Vector3f half = (direction - ray.direction).normalized();
    float power = std::max(0.0F, half.dot(point.normal));
    for (int doubling = 0; doubling < 5; ++doubling) power *= power;  // 32nd power
    reflectance += tint * (material.specular * 0.5F * power);
  }
  result.lamp = reflectance.cwiseProduct(scene.light_colour) * facing;
  return result;
}

}  // namespace

// Replaces hits on mirrors by the hits of the reflected rays.
void RadianceSampler::reflect(const World& world, std::span<const Ray> rays,
                              std::span<StaticSample> samples) {
  const Scene& scene = world.geometry().scene();
  reflected_rays_.clear();
  reflected_index_.clear();
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Hit& hit = hits_[i];
    if (hit.part < 0 || !scene.parts[hit.part].material.mirror) continue;
    const SurfacePoint point = surface_at(world, rays[i], hit, hit.distance, 0);
    const Vector3f direction =
        rays[i].direction - 2 * rays[i].direction.dot(point.flat) * point.flat;
    samples[i].mirror = true;
    samples[i].reflected_ray = {point.position + kShadowOffset * point.flat,
                                direction.normalized()};
    reflected_rays_.push_back(samples[i].reflected_ray);
    reflected_index_.push_back(i);
  }
  reflected_hits_.resize(reflected_rays_.size());
  world.trace_static(reflected_rays_, reflected_hits_);
  for (std::size_t m = 0; m < reflected_rays_.size(); ++m) {
    StaticSample& sample = samples[reflected_index_[m]];
    sample.reflected_part = reflected_hits_[m].part;
    sample.reflected_distance = reflected_hits_[m].distance;
    hits_[reflected_index_[m]] = reflected_hits_[m];
  }
}

void RadianceSampler::queue_shadow_ray(const Scene& scene, std::size_t index,
                                       const Vector3f& origin, const Vector3f& lamp) {
  const Vector3f towards = scene.light_position - origin;
  const float length = towards.norm();
  pending_shadow_rays_.push_back({index, lamp});
  shadow_.push_back({origin, towards / length});
  shadow_limits_.push_back(length);
}

void RadianceSampler::sample_static(const World& world, std::span<const Ray> rays, float footprint,
                                    std::span<StaticSample> samples) {
  const Scene& scene = world.geometry().scene();
  hits_.resize(rays.size());
  world.trace_static(rays, hits_);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    samples[i] = StaticSample{};
    samples[i].distance = hits_[i].distance;
    samples[i].part = hits_[i].part;
  }
  reflect(world, rays, samples);

  pending_shadow_rays_.clear();
  shadow_.clear();
  shadow_limits_.clear();
  for (std::size_t i = 0; i < rays.size(); ++i) {
    StaticSample& sample = samples[i];
    const Ray& ray = sample.mirror ? sample.reflected_ray : rays[i];
    const Vector3f tint =
        sample.mirror ? scene.parts[sample.part].material.colour : Vector3f(Vector3f::Ones());
    sample.unlit = tint.cwiseProduct(scene.background);
    sample.normal = -ray.direction;
    if (hits_[i].part < 0) continue;
    const float travelled = hits_[i].distance + (sample.mirror ? sample.distance : 0);
    const Shade seen = shade(world, ray, hits_[i], travelled, footprint, tint);
    sample.unlit = seen.unlit;
    sample.normal = seen.normal;
    if (!seen.lamp.isZero(0)) queue_shadow_ray(scene, i, seen.shadow_origin, seen.lamp);
  }
  occluded_.assign(shadow_.size(), 0);
  world.occlude_static(shadow_, shadow_limits_, occluded_);
  for (std::size_t s = 0; s < shadow_.size(); ++s) {
    if (occluded_[s] != 0) continue;
    StaticSample& sample = samples[pending_shadow_rays_[s].sample];
    sample.lamp = pending_shadow_rays_[s].lamp;
    sample.shadow = shadow_[s];
    sample.shadow_limit = shadow_limits_[s];
  }
}

void RadianceSampler::add_moving_surface(const World& world, const Ray& ray, const Hit& hit,
                                         float travelled, float footprint, const Vector3f& tint,
                                         std::size_t index, LightSample& sample) {
  const Shade seen = shade(world, ray, hit, travelled, footprint, tint);
  sample.light = seen.unlit;
  sample.normal = seen.normal;
  if (!seen.lamp.isZero(0)) {
    queue_shadow_ray(world.geometry().scene(), index, seen.shadow_origin, seen.lamp);
  }
}

// Adds moving parts that mirrors show. Stores their hits in hits_.
void RadianceSampler::trace_reflections(const World& world, float footprint,
                                        std::span<const StaticSample* const> still,
                                        std::span<LightSample> samples) {
  reflected_rays_.clear();
  reflected_limits_.clear();
  reflected_index_.clear();
  for (std::size_t i = 0; i < still.size(); ++i) {
    if (!still[i]->mirror || hits_[i].part >= 0) continue;
    reflected_rays_.push_back(still[i]->reflected_ray);
    reflected_limits_.push_back(still[i]->reflected_distance);
    reflected_index_.push_back(i);
  }
  reflected_hits_.resize(reflected_rays_.size());
  world.trace_moving(reflected_rays_, reflected_limits_, reflected_hits_);
  const Scene& scene = world.geometry().scene();
  for (std::size_t m = 0; m < reflected_rays_.size(); ++m) {
    const Hit& hit = reflected_hits_[m];
    if (hit.part < 0) continue;
    const std::size_t i = reflected_index_[m];
    const Vector3f tint = scene.parts[still[i]->part].material.colour;
    add_moving_surface(world, reflected_rays_[m], hit, still[i]->distance + hit.distance, footprint,
                       tint, i, samples[i]);
    samples[i].reflected_part = hit.part;
    samples[i].reflected_distance = hit.distance;
    hits_[i] = hit;
  }
}

void RadianceSampler::sample(const World& world, std::span<const Ray> rays, float footprint,
                             std::span<const StaticSample* const> still,
                             std::span<LightSample> samples) {
  hits_.resize(rays.size());
  limits_.clear();
  for (const StaticSample* sample : still) limits_.push_back(sample->distance);
  world.trace_moving(rays, limits_, hits_);

  pending_shadow_rays_.clear();
  shadow_.clear();
  shadow_limits_.clear();
  for (std::size_t i = 0; i < rays.size(); ++i) {
    LightSample& sample = samples[i];
    sample = {still[i]->unlit,
              still[i]->normal,
              still[i]->distance,
              still[i]->part,
              still[i]->reflected_part,
              still[i]->reflected_distance,
              false};
    if (hits_[i].part < 0) continue;
    sample.distance = hits_[i].distance;
    sample.part = hits_[i].part;
    sample.reflected_part = -1;
    sample.reflected_distance = 0;
    add_moving_surface(world, rays[i], hits_[i], hits_[i].distance, footprint, Vector3f::Ones(), i,
                       sample);
  }
  trace_reflections(world, footprint, still, samples);

  // Only moving surfaces need this test: `lamp` of static ones includes static shadows.
  occluded_.assign(shadow_.size(), 0);
  world.occlude_static(shadow_, shadow_limits_, occluded_);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (hits_[i].part >= 0 || still[i]->lamp.isZero(0)) continue;
    pending_shadow_rays_.push_back({i, still[i]->lamp});
    shadow_.push_back(still[i]->shadow);
    shadow_limits_.push_back(still[i]->shadow_limit);
    occluded_.push_back(0);
  }
  world.occlude_moving(shadow_, shadow_limits_, occluded_);
  for (std::size_t s = 0; s < shadow_.size(); ++s) {
    if (occluded_[s] != 0) continue;
    LightSample& sample = samples[pending_shadow_rays_[s].sample];
    sample.lit = true;
    sample.light += pending_shadow_rays_[s].lamp;
  }
}

}  // namespace raystage::simulate
