// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "compose/geometry/lights.h"
#include "compose/geometry/mesh_scene.h"
#include "compose/geometry/placement.h"
#include "compose/geometry/surface.h"
#include "compose/geometry/textures.h"
#include "compose/layers/fingerprint.h"
#include "schemas/shot_document.h"

namespace raystage {

/// A mesh in a shot: read and checked before rendering.
class GeometryLayer {
 public:
  /// `where`: the layer, for errors. `textures`: opened here as needed; must live on. Throws Error
  /// (bad input): mesh or texture missing or wrong, keys that cannot be used.
  GeometryLayer(const ShotDocument::Geometry& geometry, const std::filesystem::path& folder,
                const std::string& where, Textures& textures);

  PlacedMesh placed(double frame) const;
  int samples() const { return samples_; }
  const Mesh& mesh() const { return scene_->mesh(); }
  std::size_t bytes() const { return scene_->bytes(); }

  /// What determines its pixels at a frame: contents of the mesh's and textures' files, materials,
  /// place, samples.
  void add_to(Fingerprint& print, double frame) const;

 private:
  Placement placement_;
  int samples_ = 16;
  std::unique_ptr<const MeshScene> scene_;
  std::vector<Textures::Handle> textures_;  ///< of each material
  std::string fingerprint_;
};

/// Lights of a shot as rays see them, but for light fields. `textures` must live on. Throws Error
/// (bad input), with `where` in it, where an environment cannot be read.
Lights lights_from(const std::vector<ShotDocument::Light>& lights,
                   const std::filesystem::path& folder, Textures& textures);

/// What determines them.
void add_to(Fingerprint& print, const std::vector<ShotDocument::Light>& lights,
            const std::filesystem::path& folder);

}  // namespace raystage
