// SPDX-License-Identifier: Apache-2.0
// Renders one mesh of a scene by path tracing with Embree (thesis 7: light fields as reflection
// environment). The rays of one bounce in two rows are traced together. Diffuse surfaces receive
// direct lights with shadow rays, several per sample if they have a size, and ambient light or
// gathered environment radiance; mirrors and GGX surfaces continue the path up to 4 bounces. Input:
// meshes, lights and camera in world coordinates, metres; output: a premultiplied image with Z, P,
// N, albedo and ids. Cost: pixels x samples x rays per sample, each traced against all meshes.
#include "compose/geometry/geometry_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "base/stopwatch.h"
#include "compose/geometry/bsdf_sampling.h"
#include "compose/geometry/gathered_light.h"
#include "compose/layers/motion_vectors.h"

namespace raystage::compose {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr int kMaxBounces = 4;
constexpr int kGlossyRays = 4;  // per sample at the first bounce, then one
constexpr int kLightRays = 4;   // the same, to each light with a size
constexpr int kRowsPerTask = 2;

/// Rounding of a hit and of the surface around it: in Embree, which computes in float, relative to
/// the radius of the mesh, and in the world, relative to the distance from its origin.
constexpr double kEmbreeRounding = 8 * double{std::numeric_limits<float>::epsilon()};
constexpr double kWorldRounding = 16 * std::numeric_limits<double>::epsilon();

/// A ray of a path and its contribution to a pixel.
struct Path {
  render::WorldRay ray;
  Vector3f weight{1, 1, 1};
  Vector3f normal{0, 0, 0};  // geometric, of the surface that the ray leaves; 0: the camera
  std::uint32_t pixel = 0;   // index in the task's rows
  std::uint32_t sample = 0;  // index in the pixel
  std::uint32_t sum = 0;     // index in the sums of light
  float spread = 0;          // radians
  double distance = 0;       // length of the path before this ray, metres
  bool gathers = true;       // diffuse surfaces that it hits gather light
};

struct ShadowRay {
  render::WorldRay ray;
  Vector3f normal;  // geometric, of the surface that the ray leaves
  Vector3f light;
  std::uint32_t sum = 0;  // index in the sums of light
  double max_distance = SurfaceHit::kNone;
};

/// Renders some rows of a view, one wave of rays per bounce.
class RowRenderer {
 public:
  /// `gathered`: null unless diffuse surfaces gather light.
  RowRenderer(const GeometryScene& scene, std::size_t mesh, const render::VirtualCamera& camera,
              int samples, int begin, int end, std::span<const float> ids,
              const AdjacentViews* adjacent, LayerImage& image, GatheredLight* gathered)
      : scene_(scene),
        mesh_(mesh),
        camera_(camera),
        per_side_(static_cast<int>(std::lround(std::sqrt(samples)))),
        begin_(begin),
        end_(end),
        ids_(ids),
        adjacent_(adjacent),
        image_(image),
        gathered_(gathered),
        pixels_(static_cast<std::uint32_t>((end - begin) * camera.width)),
        light_(gathered == nullptr ? pixels_ : std::size_t{2} * pixels_, Vector3f::Zero()) {
    for (const MeshInstance& placed : scene.meshes) {
      const Vector3d centre = placed.world_from_object * placed.scene->centre();
      const double radius =
          placed.scene->radius() * placed.world_from_object.linear().colwise().norm().maxCoeff();
      rounding_.push_back(kEmbreeRounding * radius + kWorldRounding * (centre.norm() + radius));
    }
  }

  void render() {
    make_camera_rays();
    const std::vector<SurfaceHit> hits = intersect_camera_rays();
    find_nearest_samples(hits);
    if (!ids_.empty()) write_ids(hits);
    std::vector<Path> wave = std::move(paths_);
    shade(wave, hits, std::vector<std::uint32_t>(wave.size(), static_cast<std::uint32_t>(mesh_)),
          true);
    for (int bounce = 1; !paths_.empty(); ++bounce) {
      wave = std::move(paths_);
      paths_.clear();
      std::vector<std::uint32_t> met;
      const std::vector<SurfaceHit> next = intersect_all(wave, met);
      add_environment(wave, next);
      shade(wave, next, met, false);
      if (bounce < kMaxBounces) continue;
      for (const Path& path : paths_) add(path, scene_.lights.ambient);
      break;
    }
    write_pixels();
  }

 private:
  void make_camera_rays() {
    const int samples = per_side_ * per_side_;
    const auto spread = static_cast<float>(render::pixel_angle(camera_) / per_side_);
    paths_.reserve(pixels_ * static_cast<std::size_t>(samples));
    for (int y = begin_; y < end_; ++y) {
      for (int x = 0; x < camera_.width; ++x) {
        for (int s = 0; s < samples; ++s) {
          const int column = s % per_side_, row = s / per_side_;
          const double px = x + (column + 0.5) / per_side_;
          const double py = y + (row + 0.5) / per_side_;
          Path path;
          path.ray = render::pixel_ray(camera_, px, py);
          path.pixel = path.sum = static_cast<std::uint32_t>((y - begin_) * camera_.width + x);
          path.sample = static_cast<std::uint32_t>(s);
          path.spread = spread;
          paths_.push_back(path);
        }
      }
    }
  }

  std::vector<SurfaceHit> intersect_camera_rays() const {
    std::vector<render::WorldRay> rays;
    rays.reserve(paths_.size());
    for (const Path& path : paths_) rays.push_back(path.ray);
    std::vector<SurfaceHit> hits(rays.size());
    const MeshInstance& mesh = scene_.meshes[mesh_];
    mesh.scene->intersect(mesh.object_from_world, rays, 0, hits, RayCoherence::kCoherent);
    return hits;
  }

  /// Returns the ray by which a mesh is traced for one that leaves a surface. It begins above the
  /// surface by the rounding of this mesh alone: it does not hit its own surface, also at a low
  /// angle, and hits what touches that, however large it is.
  template <class Ray>
  render::WorldRay ray_for(std::size_t mesh, const Ray& leaving) const {
    return {leaving.ray.origin + rounding_[mesh] * leaving.normal.template cast<double>(),
            leaving.ray.direction};
  }

  /// Returns the first hit of each path among all meshes. `met`: receives the meshes' indices.
  std::vector<SurfaceHit> intersect_all(const std::vector<Path>& wave,
                                        std::vector<std::uint32_t>& met) const {
    std::vector<SurfaceHit> hits(wave.size());
    met.assign(wave.size(), 0);
    std::vector<render::WorldRay> rays(wave.size());
    for (std::size_t m = 0; m < scene_.meshes.size(); ++m) {
      const MeshInstance& mesh = scene_.meshes[m];
      for (std::size_t i = 0; i < wave.size(); ++i) rays[i] = ray_for(m, wave[i]);
      const std::vector<SurfaceHit> before = hits;
      mesh.scene->intersect(mesh.object_from_world, rays, 0, hits);
      for (std::size_t i = 0; i < wave.size(); ++i) {
        if (hits[i].distance < before[i].distance) met[i] = static_cast<std::uint32_t>(m);
      }
    }
    return hits;
  }

  /// Adds the environment's radiance along paths that hit nothing.
  void add_environment(const std::vector<Path>& wave, const std::vector<SurfaceHit>& hits) {
    std::vector<render::WorldRay> rays;
    std::vector<float> spread;
    std::vector<std::size_t> from;
    for (std::size_t i = 0; i < wave.size(); ++i) {
      if (hits[i].is_hit()) continue;
      rays.push_back(wave[i].ray);
      spread.push_back(wave[i].spread);
      from.push_back(i);
    }
    if (rays.empty()) return;
    std::vector<Vector3f> seen(rays.size(), scene_.lights.ambient);
    if (scene_.lights.environment_radiance) scene_.lights.environment_radiance(rays, spread, seen);
    for (std::size_t i = 0; i < from.size(); ++i) add(wave[from[i]], seen[i]);
  }

  void shade(const std::vector<Path>& wave, const std::vector<SurfaceHit>& hits,
             const std::vector<std::uint32_t>& met, bool is_first) {
    paths_.clear();
    std::vector<ShadowRay> shadows;
    for (std::size_t i = 0; i < wave.size(); ++i) {
      if (!hits[i].is_hit()) continue;
      const Path& path = wave[i];
      const MeshInstance& mesh = scene_.meshes[met[i]];
      const SurfacePoint point = surface_point_at(mesh, scene_.textures, ray_for(met[i], path),
                                                  hits[i], double{path.spread}, path.distance);
      if (is_first) add_albedo(path, point);
      Path next = path;
      next.weight = path.weight.cwiseProduct(point.color);
      next.distance = path.distance + hits[i].distance;
      next.normal = point.geometric_normal.cast<float>();
      next.ray.origin = point.position;
      switch (point.material->kind) {
        case Material::Kind::kDiffuse:
          light_diffuse(next, point, is_first, shadows);
          break;
        case Material::Kind::kMirror:
          next.ray.direction =
              outwards(reflect(path.ray.direction, point.normal), point.geometric_normal);
          paths_.push_back(next);
          break;
        case Material::Kind::kGlossy:
          scatter(next, point, path.ray.direction, is_first ? kGlossyRays : 1);
          break;
      }
    }
    trace_shadow_rays(shadows, is_first ? RayCoherence::kCoherent : RayCoherence::kIncoherent);
  }

  /// Adds the light that arrives at a diffuse surface. What the camera's rays meet gathers light in
  /// sums of its own, without the surface's colour.
  void light_diffuse(const Path& at, const SurfacePoint& point, bool is_first,
                     std::vector<ShadowRay>& shadows) {
    const Lights& lights = scene_.lights;
    const int light_rays = is_first ? kLightRays : 1;  // to each light with a size
    for (std::size_t i = 0; i < lights.direct.size(); ++i) {
      const int rays = lights.direct[i].has_size() ? light_rays : 1;
      for (int ray = 0; ray < rays; ++ray) light_from(i, at, point, ray, rays, shadows);
    }
    if (scene_.headlight) {
      const Vector3d towards = camera_.is_equirectangular
                                   ? Vector3d((camera_.pose.position - point.position).normalized())
                                   : *scene_.headlight;
      const double cosine = std::max(0.0, point.normal.dot(towards));
      light_[at.sum] += at.weight * static_cast<float>(cosine);
    }
    if (!at.gathers || gathered_ == nullptr) return add(at, lights.ambient);
    Path gathered = at;
    gathered.gathers = false;
    gathered.weight = at.weight / static_cast<float>(lights.gather_rays);
    if (is_first) {
      gathered.weight.setConstant(1 / static_cast<float>(lights.gather_rays));
      gathered.sum = pixels_ + at.pixel;
      gathered_->color[first_pixel() + at.pixel] += point.color;
      ++gathered_->samples[first_pixel() + at.pixel];
    }
    gathered.spread = static_cast<float>(std::sqrt(2.0 / lights.gather_rays));
    for (int i = 0; i < lights.gather_rays; ++i) {
      gathered.ray.direction = outwards(
          sample_diffuse_direction(
              point.normal, is_first ? gathering_at(at, i) : random_at(at, i, lights.gather_rays)),
          point.geometric_normal);
      paths_.push_back(gathered);
    }
  }

  void light_from(std::size_t index, const Path& at, const SurfacePoint& point, int ray, int rays,
                  std::vector<ShadowRay>& shadows) {
    const DirectLight& light = scene_.lights.direct[index];
    const LightSample sample = sample_light(
        light, point.position, random_at(at, ray, rays, static_cast<std::uint32_t>(index) + 1));
    const double cosine = point.normal.dot(sample.towards);
    if (!(cosine > 0) || !(point.geometric_normal.dot(sample.towards) > 0)) return;
    const Vector3f lit =
        at.weight.cwiseProduct(light.color) * static_cast<float>(cosine * sample.strength / rays);
    if (light.casts_shadows) {
      shadows.push_back(
          {{point.position, sample.towards}, at.normal, lit, at.sum, sample.distance});
    } else {
      light_[at.sum] += lit;
    }
  }

  void scatter(const Path& at, const SurfacePoint& point, const Vector3d& direction, int rays) {
    const double alpha = double{point.material->roughness} * double{point.material->roughness};
    for (int i = 0; i < rays; ++i) {
      const DirectionSample glossy =
          sample_ggx_direction(point.normal, -direction, alpha, random_at(at, i, rays));
      Path next = at;
      next.weight = at.weight * static_cast<float>(glossy.weight / rays);
      next.spread = std::max(at.spread, static_cast<float>(alpha / std::sqrt(rays)));
      next.ray.direction = outwards(glossy.direction, point.geometric_normal);
      if (glossy.weight > 0) paths_.push_back(next);
    }
  }

  void trace_shadow_rays(const std::vector<ShadowRay>& shadows, RayCoherence order) {
    std::vector<render::WorldRay> rays(shadows.size());
    std::vector<double> max_distance;
    for (const ShadowRay& shadow : shadows) max_distance.push_back(shadow.max_distance);
    std::vector<std::uint8_t> occluded(shadows.size(), 0);
    for (std::size_t m = 0; m < scene_.meshes.size(); ++m) {
      const MeshInstance& mesh = scene_.meshes[m];
      for (std::size_t i = 0; i < rays.size(); ++i) rays[i] = ray_for(m, shadows[i]);
      mesh.scene->occlude(mesh.object_from_world, rays, 0, max_distance, occluded, order);
    }
    for (std::size_t i = 0; i < shadows.size(); ++i) {
      if (occluded[i] == 0) light_[shadows[i].sum] += shadows[i].light;
    }
  }

  /// Mirrors directions that interpolated normals send into the surface back to its front.
  static Vector3d outwards(const Vector3d& direction, const Vector3d& geometric_normal) {
    const double out = direction.dot(geometric_normal);
    return out > 0 ? direction : Vector3d((direction - 2 * out * geometric_normal).normalized());
  }

  /// Returns the sample point of a ray: the rays of all samples of a pixel share one sequence.
  /// `use` separates the sequences of what a sample does with them.
  std::array<double, 2> random_at(const Path& path, int ray, int rays,
                                  std::uint32_t use = 0) const {
    const std::uint32_t x = path.pixel % static_cast<std::uint32_t>(camera_.width);
    const std::uint32_t y =
        static_cast<std::uint32_t>(begin_) + path.pixel / static_cast<std::uint32_t>(camera_.width);
    return r2_sample(
        y * 65536 + x + use * 0x9E3779B9U,
        path.sample * static_cast<std::uint32_t>(rays) + static_cast<std::uint32_t>(ray));
  }

  /// Returns the sample point of a ray with which what the camera sees gathers light: the pixels of
  /// a square share one sequence, whose parts share_gathered_light() joins.
  std::array<double, 2> gathering_at(const Path& path, int ray) const {
    const auto rays = static_cast<std::uint32_t>(scene_.lights.gather_rays);
    const auto samples = static_cast<std::uint32_t>(per_side_ * per_side_);
    const int x = static_cast<int>(path.pixel) % camera_.width;
    const int y = begin_ + static_cast<int>(path.pixel) / camera_.width;
    return r2_sample(
        0, (gathering_part(x, y) * samples + path.sample) * rays + static_cast<std::uint32_t>(ray));
  }

  void add(const Path& path, const Vector3f& light) {
    light_[path.sum] += path.weight.cwiseProduct(light);
  }

  void add_albedo(const Path& path, const SurfacePoint& point) {
    const std::size_t at = first_pixel() + path.pixel;
    if (nearest_[path.pixel].sample == path.sample) {
      for (Eigen::Index c = 0; c < 3; ++c) {
        const auto i = 3 * at + static_cast<std::size_t>(c);
        image_.aovs[0].values[i] = static_cast<float>(point.position(c));
        image_.aovs[1].values[i] = static_cast<float>(point.normal(c));
      }
      if (adjacent_ != nullptr) write_motion(at, point);
    }
    const auto share = 1 / static_cast<float>(nearest_[path.pixel].hits);
    for (Eigen::Index c = 0; c < 3; ++c) {
      image_.aovs[2].values[3 * at + static_cast<std::size_t>(c)] += share * point.color(c);
    }
  }

  void write_motion(std::size_t pixel, const SurfacePoint& point) {
    const std::vector<ObjectMotion>& motion = scene_.meshes[mesh_].motion;
    const ObjectMotion moved = motion.empty() ? ObjectMotion{} : motion[point.object];
    const auto at = [](const Eigen::Vector3d& p) {
      return Eigen::Vector4d(p.x(), p.y(), p.z(), 1);
    };
    std::ranges::copy(motion_vector(camera_, *adjacent_,
                                    {at(moved.before_from_now * point.position), at(point.position),
                                     at(moved.after_from_now * point.position)}),
                      image_.aovs[3].values.begin() + static_cast<std::ptrdiff_t>(4 * pixel));
  }

  /// Counts the hits of each pixel and finds its nearest sample.
  void find_nearest_samples(const std::vector<SurfaceHit>& hits) {
    nearest_.assign(pixels_, {});
    for (std::size_t i = 0; i < paths_.size(); ++i) {
      if (!hits[i].is_hit()) continue;
      Nearest& pixel = nearest_[paths_[i].pixel];
      ++pixel.hits;
      const double z = render::depth_of(camera_, paths_[i].ray, hits[i].distance);
      if (!(z < pixel.z)) continue;
      pixel.z = z;
      pixel.sample = paths_[i].sample;
    }
  }

  /// Writes the ids and shares of the objects in each pixel, whose samples are consecutive.
  void write_ids(const std::vector<SurfaceHit>& hits) {
    const std::vector<std::uint32_t>& triangle_objects =
        scene_.meshes[mesh_].scene->mesh().triangle_objects;
    std::vector<std::array<float, 2>> seen;
    for (std::size_t i = 0; i < paths_.size();) {
      const std::uint32_t pixel = paths_[i].pixel;
      seen.clear();
      for (; i < paths_.size() && paths_[i].pixel == pixel; ++i) {
        if (!hits[i].is_hit()) continue;
        const float id = ids_[triangle_objects[hits[i].triangle]];
        const auto same = std::ranges::find_if(seen, [&](const auto& s) { return s[0] == id; });
        if (same == seen.end()) {
          seen.push_back({id, 1});
        } else {
          (*same)[1] += 1;
        }
      }
      std::ranges::stable_sort(seen, [](const auto& a, const auto& b) { return a[1] > b[1]; });
      float* ids = &image_.ids[2 * kIdRanks * (first_pixel() + pixel)];
      for (std::size_t rank = 0; rank < std::min(kIdRanks, seen.size()); ++rank) {
        ids[2 * rank] = seen[rank][0];
        ids[2 * rank + 1] = seen[rank][1] / static_cast<float>(nearest_[pixel].hits);
      }
    }
  }

  void write_pixels() {
    const auto samples = static_cast<float>(per_side_ * per_side_);
    for (std::size_t i = 0; i < pixels_; ++i) {
      const std::size_t at = first_pixel() + i;
      if (nearest_[i].hits == 0) continue;
      if (gathered_ != nullptr) gathered_->radiance[at] = light_[pixels_ + i];
      for (std::size_t c = 0; c < 3; ++c) image_.rgba[4 * at + c] = light_[i](c) / samples;
      image_.rgba[4 * at + 3] = static_cast<float>(nearest_[i].hits) / samples;
      image_.z[at] = static_cast<float>(nearest_[i].z);
    }
  }

  std::size_t first_pixel() const {
    return static_cast<std::size_t>(begin_) * static_cast<std::size_t>(camera_.width);
  }

  struct Nearest {
    double z = std::numeric_limits<double>::infinity();
    std::uint32_t sample = 0;
    int hits = 0;  // number of samples that hit the mesh
  };

  const GeometryScene& scene_;
  std::size_t mesh_;
  const render::VirtualCamera& camera_;
  int per_side_, begin_, end_;
  std::span<const float> ids_;
  const AdjacentViews* adjacent_;
  LayerImage& image_;
  GatheredLight* gathered_;
  std::uint32_t pixels_;          // of these rows
  std::vector<double> rounding_;  // of each mesh, metres
  /// Of each pixel, summed over its samples: its light, then what it gathers.
  std::vector<Vector3f> light_;
  std::vector<Nearest> nearest_;
  std::vector<Path> paths_;  // of the next wave
};

}  // namespace

LayerImage render_geometry(const GeometryScene& scene, std::size_t mesh,
                           const render::VirtualCamera& camera, int samples,
                           std::span<const float> ids, const AdjacentViews* adjacent) {
  LayerImage image = transparent_layer_image(camera.width, camera.height);
  if (!ids.empty()) image.ids.assign(image.pixels() * 2 * kIdRanks, 0.0F);
  const auto add = [&](const char* name, const std::vector<std::string>& channels, bool is_colour) {
    image.aovs.push_back({name, channels, is_colour, 0, {}});
    image.aovs.back().values.assign(image.pixels() * 3, 0.0F);
  };
  add("P", {"X", "Y", "Z"}, false);
  add("N", {"X", "Y", "Z"}, false);
  add("albedo", {"R", "G", "B"}, true);
  if (adjacent != nullptr) image.aovs.push_back(empty_motion_aov(image.pixels()));
  std::optional<GatheredLight> gathered;
  if (scene.lights.gather_rays > 0) gathered.emplace(image.pixels());
  // A fixed partition: Embree's traversal of a packet may depend on all of its rays.
  raystage::parallel_for(0, (camera.height + kRowsPerTask - 1) / kRowsPerTask, [&](int task) {
    const Stopwatch watch;
    const int begin = task * kRowsPerTask;
    RowRenderer(scene, mesh, camera, samples, begin, std::min(begin + kRowsPerTask, camera.height),
                ids, adjacent, image, gathered ? &*gathered : nullptr)
        .render();
    if (scene.busy_ns != nullptr) *scene.busy_ns += std::llround(1e6 * watch.ms());
  });
  if (gathered) share_gathered_light(*gathered, camera, samples, image);
  return image;
}

}  // namespace raystage::compose
