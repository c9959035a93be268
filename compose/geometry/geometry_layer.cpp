// SPDX-License-Identifier: Apache-2.0
#include "compose/geometry/geometry_layer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numbers>
#include <set>
#include <span>
#include <utility>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/posix_file.h"
#include "compose/geometry/frustum_culling.h"
#include "compose/geometry/geometry_scene.h"

namespace raystage::compose {
namespace {

using Eigen::Vector3f;

Vector3f color_from(const std::array<double, 3>& c) {
  return {static_cast<float>(c[0]), static_cast<float>(c[1]), static_cast<float>(c[2])};
}

template <class T>
void add_values(Fingerprint& print, const char* label, const std::vector<T>& values) {
  print.text(label, {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)});
}

/// `File`: a path or ContainedPath.
template <class File>
void add_file(Fingerprint& print, const File& file) {
  std::string chunk(std::size_t{1} << 20, '\0');
  for (std::uint64_t offset = 0, got = chunk.size(); got == chunk.size(); offset += got) {
    got = read_file_part(file, offset, std::as_writable_bytes(std::span(chunk)));
    print.text("file", {chunk.data(), got});
  }
}

/// Replaces the file's materials by that of the shot.
void replace_materials(Mesh& mesh, const schemas::ShotDocument::Material& by,
                       const std::filesystem::path& folder) {
  using Kind = Material::Kind;
  for (Material& material : mesh.materials) {
    material.kind = by.kind == "mirror"   ? Kind::kMirror
                    : by.kind == "glossy" ? Kind::kGlossy
                                          : Kind::kDiffuse;
    material.roughness = static_cast<float>(by.roughness);
    if (by.color) material.color = color_from(*by.color);
    if (by.texture.empty()) continue;
    material.texture = {folder, by.texture};
    material.is_texture_of_shot = true;
    material.embedded_texture = nullptr;
  }
}

std::string fingerprint_of(const Mesh& mesh) {
  Fingerprint print;
  add_values(print, "positions", mesh.positions);
  add_values(print, "normals", mesh.normals);
  add_values(print, "uvs", mesh.uvs);
  add_values(print, "corners", mesh.corners);
  add_values(print, "object_of", mesh.triangle_objects);
  for (const Mesh::Object& object : mesh.objects) {
    print.text("object", object.name).integer("material", object.material);
  }
  for (const Material& material : mesh.materials) {
    print.integer("kind", static_cast<int>(material.kind)).number("roughness", material.roughness);
    for (const float c : material.color) print.number("color", c);
    if (material.embedded_texture) print.text("image", material.embedded_texture->bytes);
    if (material.texture.relative.empty()) continue;
    if (material.is_texture_of_shot) {
      add_file(print, material.texture.path());
    } else {
      add_file(print, material.texture);
    }
  }
  return print.hex();
}

bool is_gltf(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension == ".gltf" || extension == ".glb";
}

/// Opens the texture of a material; null if it has none. `file`: of the mesh, named by errors.
Textures::Handle open_texture(const Material& material, Textures& textures,
                              const std::filesystem::path& file) {
  if (material.embedded_texture && material.embedded_texture->format.empty()) {
    throw Error::bad_input("the texture in the mesh file has a format that cannot be read",
                           material.embedded_texture->name, "Export it as PNG or JPEG");
  }
  if (material.embedded_texture) return textures.open(material.embedded_texture);
  if (material.texture.relative.empty()) return nullptr;
  const std::filesystem::path path = material.texture.path().lexically_normal();
  if (!path.has_filename()) {
    throw Error::bad_input("the mesh file has neither its texture nor the path of it",
                           file.string(),
                           "Export it with its textures embedded (Blender's FBX: Path Mode Copy, "
                           "with the icon next to it pressed)");
  }
  try {
    return material.is_texture_of_shot ? textures.open(path) : textures.open(material.texture);
  } catch (const Error& error) {
    if (error.exit_code() != ExitCode::kBadInput) throw;
    throw Error::bad_input(
        error.what_happened() + ", a texture of the mesh " + file.string(), error.where(),
        error.what_to_do() + (material.is_texture_of_shot
                                  ? "; it is relative to the shot's folder"
                                  : "; it is relative to the mesh file, below whose folder it must "
                                    "be unless links are permitted"));
  }
}

/// Renders the layer's mesh among the others of a frame.
class MeshRenderer final : public LayerRenderer {
 public:
  explicit MeshRenderer(int samples) : samples_(samples) {}

  bool may_show(const LayerView& view) const override {
    if (view.mesh < 0) return false;
    return may_intersect_frustum(view.scene->meshes[view.mesh], view.camera.view);
  }
  LayerImage render(const LayerView& view) const override {
    return render_geometry(*view.scene, static_cast<std::size_t>(view.mesh), view.camera.view,
                           samples_, view.object_ids,
                           view.camera.adjacent ? &*view.camera.adjacent : nullptr);
  }

 private:
  int samples_;
};

}  // namespace

GeometryLayer::GeometryLayer(const schemas::ShotDocument::Geometry& geometry, FrameRate fps,
                             const std::filesystem::path& folder, const std::string& where,
                             Textures& textures)
    : transform_(geometry, where), samples_(geometry.samples) {
  const std::filesystem::path path = (folder / geometry.file).lexically_normal();
  MeshFile file = read_mesh_file(path, {.applies_unit = geometry.applies_unit});
  for (Material& material : file.mesh.materials) {
    material.color = textures.working_from_rec709() * material.color;
  }
  if (geometry.material) replace_materials(file.mesh, *geometry.material, folder);
  std::set<const EmbeddedImage*> images;
  for (const Material& material : file.mesh.materials) {
    textures_.push_back(open_texture(material, textures, path));
    images.insert(material.embedded_texture.get());
  }
  for (const EmbeddedImage* image : images)
    image_bytes_ += image == nullptr ? 0 : image->bytes.size();
  has_unread_emission_ = file.is_emissive && !geometry.material;
  if (geometry.is_animated && file.is_animated) {
    has_unread_animation_ = !is_gltf(path) || file.is_deformable;
    if (is_gltf(path)) moving_ = read_motion(geometry, fps, file, path, where);
  }
  scene_ = std::make_shared<const EmbreeMesh>(
      MeshFile::place(std::move(file.mesh), file.parts, file.file_from_node, path), path.string());
  fingerprint_ = fingerprint_of(scene_->mesh());
}

std::unique_ptr<const GeometryLayer::Moving> GeometryLayer::read_motion(
    const schemas::ShotDocument::Geometry& geometry, FrameRate fps, const MeshFile& file,
    const std::filesystem::path& path, const std::string& where) {
  std::vector<std::size_t> nodes;
  for (const MeshFile::Part& part : file.parts) nodes.push_back(part.node);
  std::optional<MeshAnimation> animation;
  try {
    animation = parse_mesh_animation(read_file(path, kMaxSceneBytes), path, {geometry.fps, fps},
                                     file.node_names, nodes);
  } catch (const Error& error) {
    if (error.exit_code() != ExitCode::kBadInput) throw;
    throw Error::bad_input(error.what_happened(), error.where(),
                           error.what_to_do() + ", or write \"animated\": false");
  }
  if (!animation) return nullptr;
  GltfFrames frames =
      gltf_frames(animation->timing, animation->key_seconds, path, where + "/file",
                  "Add the rate of the program that wrote the file as fps of the geometry");
  frames.zero += geometry.frame_offset;
  return std::make_unique<const Moving>(Moving{file, std::move(*animation), frames, path});
}

std::optional<std::array<double, 2>> GeometryLayer::key_frames() const {
  if (!moving_) return std::nullopt;
  const std::vector<double>& keys = moving_->animation.key_seconds;
  return std::array{moving_->frames.frame(keys.front()), moving_->frames.frame(keys.back())};
}

std::vector<Eigen::Affine3d> GeometryLayer::file_from_node(double frame) const {
  return moving_->animation.file_from_node(moving_->frames.seconds(frame));
}

GeometryLayer::BoundingSphere GeometryLayer::bounds_at(double frame) const {
  const Eigen::Affine3d world_from_object = transform_.world_from_object(frame);
  // The transform scales all axes alike.
  return {world_from_object * scene_->centre(),
          scene_->radius() * world_from_object.linear().col(0).norm()};
}

MeshInstance GeometryLayer::instance_at(double frame) const {
  const Eigen::Affine3d world_from_object = transform_.world_from_object(frame);
  std::shared_ptr<const EmbreeMesh> scene = scene_;
  if (moving_) {
    scene =
        std::make_shared<const EmbreeMesh>(MeshFile::place(moving_->file.mesh, moving_->file.parts,
                                                           file_from_node(frame), moving_->path),
                                           moving_->path.string());
  }
  return {std::move(scene), textures_, world_from_object, world_from_object.inverse()};
}

std::vector<ObjectMotion> GeometryLayer::motion_at(double frame) const {
  const std::size_t objects = mesh().objects.size();
  // Of each object: its place in the world.
  const auto places = [&](double at) {
    std::vector<Eigen::Affine3d> world(objects, transform_.world_from_object(at));
    if (!moving_) return world;
    const std::vector<Eigen::Affine3d> nodes = file_from_node(at);
    for (std::size_t i = 0; i < objects; ++i)
      world[i] = world[i] * nodes[moving_->file.parts[i].node];
    return world;
  };
  const std::vector<Eigen::Affine3d> before = places(frame - 1), now = places(frame),
                                     after = places(frame + 1);
  std::vector<ObjectMotion> motion;
  for (std::size_t i = 0; i < objects; ++i) {
    const Eigen::Affine3d local_from_now = now[i].inverse();
    motion.push_back({before[i] * local_from_now, after[i] * local_from_now});
  }
  return motion;
}

void GeometryLayer::add_to_fingerprint(Fingerprint& print, double frame,
                                       const ShownTick& /*shown*/) const {
  print.text("geometry", fingerprint_).integer("samples", samples_);
  const Eigen::Affine3d placed = transform_.world_from_object(frame);
  for (const double value : placed.matrix().reshaped()) print.number("placed", value);
  if (!moving_) return;
  for (const Eigen::Affine3d& node : file_from_node(frame)) {
    for (const double value : node.matrix().reshaped()) print.number("node", value);
  }
}

std::vector<std::string> GeometryLayer::object_names(const std::string& layer) const {
  std::vector<std::string> names;
  for (const Mesh::Object& object : mesh().objects) names.push_back(layer + "/" + object.name);
  return names;
}

std::size_t GeometryLayer::aov_bytes_per_pixel() const {
  return std::size_t{9} * sizeof(float);  // P, N and albedo
}

std::unique_ptr<const LayerRenderer> GeometryLayer::make_renderer(
    const LayerRendererOptions& /*options*/) const {
  return std::make_unique<const MeshRenderer>(samples_);
}

Lights make_lights(const std::vector<schemas::ShotDocument::Light>& lights,
                   const std::filesystem::path& folder, Textures& textures) {
  struct Environment {
    Textures::Handle picture;
    float strength;
    double sine, cosine;  // of the rotation about y
  };
  Lights result;
  std::vector<Environment> environments;
  for (const schemas::ShotDocument::Light& light : lights) {
    if (light.ambient) {
      result.ambient += color_from(*light.ambient);
    } else if (light.direction) {
      const auto& d = *light.direction;
      result.direct.push_back({-Eigen::Vector3d(d[0], d[1], d[2]).stableNormalized(),
                               color_from(light.color), light.shadows,
                               light.angle_deg / 2 * std::numbers::pi / 180});
    } else if (light.position) {
      DirectLight sphere{.color = color_from(light.color), .casts_shadows = light.shadows};
      sphere.position = Eigen::Vector3d(light.position->data());
      sphere.radius = light.radius_m;
      result.direct.push_back(sphere);
    } else if (!light.light_field.empty()) {
      result.gather_rays = std::max(result.gather_rays, light.rays);
    } else {
      const double angle = light.rotation_deg * std::numbers::pi / 180;
      environments.push_back({textures.open((folder / light.environment).lexically_normal()),
                              static_cast<float>(light.strength), std::sin(angle),
                              std::cos(angle)});
      result.gather_rays = std::max(result.gather_rays, light.rays);
    }
  }
  if (environments.empty()) return result;
  result.environment_radiance = [environments, &textures](std::span<const render::WorldRay> rays,
                                                          std::span<const float> spread,
                                                          std::span<Vector3f> seen) {
    for (std::size_t i = 0; i < rays.size(); ++i) {
      seen[i].setZero();
      const Eigen::Vector3d& d = rays[i].direction;
      for (const Environment& e : environments) {
        const Eigen::Vector3d turned(e.cosine * d.x() - e.sine * d.z(), d.y(),
                                     e.sine * d.x() + e.cosine * d.z());
        seen[i] += e.strength * textures.environment_color(e.picture, turned, spread[i]);
      }
    }
  };
  return result;
}

void add_to_fingerprint(Fingerprint& print, const std::vector<schemas::ShotDocument::Light>& lights,
                        const std::filesystem::path& folder) {
  for (const schemas::ShotDocument::Light& light : lights) {
    for (const auto& values :
         {light.ambient, light.direction, light.position, std::optional(light.color)}) {
      for (const double value : values.value_or(std::array<double, 3>{})) {
        print.number("light", value);
      }
    }
    print.integer("shadows", light.shadows ? 1 : 0).number("turn", light.rotation_deg);
    print.number("angle", light.angle_deg).number("radius", light.radius_m);
    print.number("strength", light.strength).integer("rays", light.rays);
    print.text("light_field", light.light_field);
    if (!light.environment.empty()) {
      add_file(print, (folder / light.environment).lexically_normal());
    }
  }
}

}  // namespace raystage::compose
