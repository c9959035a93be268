// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/frame_rate.h"
#include "compose/geometry/animated_transform.h"
#include "compose/geometry/embree_mesh.h"
#include "compose/geometry/lights.h"
#include "compose/geometry/mesh_animation.h"
#include "compose/geometry/surface_point.h"
#include "compose/geometry/textures.h"
#include "compose/layers/layer.h"
#include "schemas/shot_document.h"

namespace raystage::compose {

/// A mesh in a shot: read and checked before rendering. Meshes whose nodes move are built anew for
/// each frame.
class GeometryLayer final : public Layer {
 public:
  /// Reads and checks the mesh. `fps`: of the shot. `where`: named by errors. `textures`: opens
  /// textures as needed; referred to. Throws Error (bad input) if the mesh or a texture is missing
  /// or wrong, or for unusable keys.
  GeometryLayer(const schemas::ShotDocument::Geometry& geometry, FrameRate fps,
                const std::filesystem::path& folder, const std::string& where, Textures& textures);

  MeshInstance instance_at(double frame) const;
  /// Returns how each object moves between a frame and the adjacent ones.
  std::vector<ObjectMotion> motion_at(double frame) const;
  struct BoundingSphere {
    Eigen::Vector3d centre;  ///< world, metres
    double radius = 0;
  };
  /// Returns the bounds at a frame without the motion of the file's nodes.
  BoundingSphere bounds_at(double frame) const;
  int samples() const { return samples_; }
  /// Returns whether the file has an animation that is not read: of other formats than glTF, or of
  /// bones and morph targets.
  bool has_unread_animation() const { return has_unread_animation_; }
  /// Returns whether a material of the file, which the shot does not replace, emits light, which is
  /// not rendered.
  bool has_unread_emission() const { return has_unread_emission_; }
  /// Returns the frames of the first and the last key; none: nothing moves.
  std::optional<std::array<double, 2>> key_frames() const;
  /// Returns the mesh, without its animation.
  const Mesh& mesh() const { return scene_->mesh(); }

  /// Adds the contents of the mesh's and textures' files, materials, transform and samples.
  void add_to_fingerprint(Fingerprint& print, double frame, const ShownTick& shown) const override;
  /// Returns names such as "LAYER/OBJECT".
  std::vector<std::string> object_names(const std::string& layer) const override;
  std::size_t shared_bytes() const override {
    return scene_->bytes() + image_bytes_ + (moving_ ? moving_->file.mesh.bytes() : 0);
  }
  std::size_t frame_bytes() const override { return moving_ ? scene_->bytes() : 0; }
  std::size_t aov_bytes_per_pixel() const override;
  const GeometryLayer* as_geometry() const override { return this; }
  LayerStage stage() const override { return LayerStage::kGeometry; }
  std::unique_ptr<const LayerRenderer> make_renderer(
      const LayerRendererOptions& options) const override;

 private:
  AnimatedTransform transform_;
  int samples_ = 16;
  bool has_unread_animation_ = false, has_unread_emission_ = false;
  std::size_t image_bytes_ = 0;  ///< of textures in the file
  /// An animated mesh in the coordinates of its nodes.
  struct Moving {
    MeshFile file;
    MeshAnimation animation;
    GltfFrames frames;
    std::filesystem::path path;
  };
  std::vector<Eigen::Affine3d> file_from_node(double frame) const;
  /// Returns null if no mesh moves.
  static std::unique_ptr<const Moving> read_motion(const schemas::ShotDocument::Geometry& geometry,
                                                   FrameRate fps, const MeshFile& file,
                                                   const std::filesystem::path& path,
                                                   const std::string& where);

  std::shared_ptr<const EmbreeMesh> scene_;
  std::unique_ptr<const Moving> moving_;    ///< null: nothing moves in the file
  std::vector<Textures::Handle> textures_;  ///< of each material
  std::string fingerprint_;
};

/// Returns the lights of a shot except light fields. `textures`: referred to. Throws Error (bad
/// input) if an environment cannot be read.
Lights make_lights(const std::vector<schemas::ShotDocument::Light>& lights,
                   const std::filesystem::path& folder, Textures& textures);

/// Adds everything that determines the lights.
void add_to_fingerprint(Fingerprint& print, const std::vector<schemas::ShotDocument::Light>& lights,
                        const std::filesystem::path& folder);

}  // namespace raystage::compose
