// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "compose/camera/shot_camera.h"
#include "compose/exr/header.h"
#include "compose/geometry/geometry_layer.h"
#include "compose/geometry/geometry_view.h"
#include "compose/layers/clip.h"
#include "compose/layers/fingerprint.h"
#include "compose/layers/light_field_layer.h"
#include "compose/plate.h"
#include "compose/shot_colors.h"
#include "render/view_hosts.h"
#include "schemas/hole_fill.h"
#include "schemas/shot_document.h"

namespace raystage {

/// Changes whenever the same inputs give other pixels, so that `--existing skip` renders them anew.
inline constexpr int kReconstructionVersion = 5;

/// What a frame of the shot shows.
struct PlannedFrame {
  int frame = 0;
  std::vector<ShownInstant> shown;  ///< of each layer; of those that are no light field, nothing

  bool holds() const;
};

/// In place of what the shot says.
struct ShotPlanOptions {
  std::optional<HoleFill> fill = {};
  OptionValues target =
      {};  ///< not empty: the method `auto` with these options, for every light field
  std::string layout = "";                  ///< not empty: of the EXR files
  std::filesystem::path color_config = {};  ///< not empty: OpenColorIO's
  std::vector<std::string> aovs = {};       ///< beside those of the shot
  /// Light fields and meshes are opened that show in one of these; none: in a frame of the shot.
  std::optional<std::vector<int>> frames = {};
  /// Holds the data that methods derive from takes (DIR/depth/...); empty: each take's folder does.
  /// Does not change the pixels, nor the fingerprint.
  std::filesystem::path cache_folder = {};
  /// What paths in the shot are relative to; empty: the shot file's folder.
  std::filesystem::path folder = {};
  /// Who holds the takes' archives; null: each take's folder does. Refers to it.
  TakeHosts* hosts = nullptr;
};

/// A shot with its takes and meshes opened and everything checked that can be before rendering.
/// Those of layers that show nothing are left alone.
class ShotPlan {
 public:
  /// Throws Error (bad input): the shot, its camera or a light field cannot be used, unknown
  /// compression or layout.
  explicit ShotPlan(const std::filesystem::path& shot_file, const ShotPlanOptions& options = {});

  const ShotDocument& shot() const { return shot_; }
  std::size_t layers() const { return shot_.layers.size(); }
  /// Of a layer; null: it is none, or shows nothing.
  const LightFieldLayer* light_field(std::size_t layer) const { return light_fields_[layer].get(); }
  /// Of a layer; null: it is none, or shows nothing.
  const GeometryLayer* geometry(std::size_t layer) const { return geometries_[layer].get(); }
  /// Of a layer; null: it is none, or shows nothing.
  const PlateLayer* plate(std::size_t layer) const { return plates_[layer].get(); }
  /// All meshes that are visible at a frame where they stand, and what lights them.
  /// `mesh_of_layer`: index into its meshes of each layer; -1 for others.
  GeometryScene geometry_at(int frame, std::vector<int>& mesh_of_layer) const;
  /// For Cryptomatte: of each object of a layer that may be visible; none where nobody asks.
  /// "LAYER/OBJECT" of meshes, else "LAYER".
  const std::vector<std::string>& object_names(std::size_t layer) const {
    return object_names_[layer];
  }
  /// What meshes take, with their textures at most.
  std::size_t geometry_bytes() const;
  std::span<const Clip> clips(std::size_t layer) const { return clips_[layer]; }
  /// Whether a layer can show anything at a frame: in its range, of some opacity, not clipped away,
  /// not behind a solid that hides all.
  bool is_visible(std::size_t layer, int frame) const;
  /// Whether a light field is asked for rays at a frame: visible, or a light on visible geometry.
  bool is_needed(std::size_t layer, int frame) const;
  /// Layers whose light fields are lights, in the order in which they are asked, with strengths:
  /// one, or those around a volume.
  struct LayerLight {
    std::vector<std::size_t> layers;
    double strength = 1;
  };
  const std::vector<LayerLight>& light_field_lights() const { return layer_lights_; }
  /// How many layers up to this one, the foremost of its volume, make one picture: 1 without one.
  std::size_t layers_of_picture(std::size_t layer) const;

  const ShotColors& colors() const { return colors_; }
  /// As ShotPlanOptions.
  const std::filesystem::path& cache_folder() const { return cache_folder_; }
  TakeHosts* hosts() const { return hosts_; }
  /// Whether the files are to tell an AOV of this name (ShotDocument::Output::aovs).
  bool wants(std::string_view aov) const;
  /// Whether one of them is among what RendererSettings::measure_coverage gives.
  bool measures_coverage() const;

  /// The views of a frame: left and right, or one.
  std::vector<Eye> eyes() const { return camera_.eyes(); }
  /// With overscan.
  VirtualCamera camera(int frame, Eye eye) const { return exr_camera(frame, eye).view; }

  /// With kError throws Error (bad input) listing the frames for which a visible light field has
  /// nothing.
  std::vector<PlannedFrame> plan(std::span<const int> frames, MissingFrames policy) const;

  /// Throws Error (bad input) where a file that a method reads for one of the frames is missing, or
  /// the camera is nowhere.
  void check_files(std::span<const PlannedFrame> frames) const;

  /// Of everything that determines the file of a frame: the camera at it, layers, size and output
  /// of the shot, take.json and rig.json, time and XXH3 of each source frame (those of the ticks
  /// before and after, too, where the method looks at them), kReconstructionVersion. Not of paths,
  /// threads or other frames.
  std::string fingerprint(const PlannedFrame& frame, bool chromaticities) const;
  /// Of take and method the first light field's.
  ExrMetadata metadata(const PlannedFrame& frame) const;
  ExrCamera exr_camera(int frame, Eye eye) const;

 private:
  void find_layer_lights();
  bool is_light(std::size_t layer) const;
  bool is_shown(std::size_t layer, int frame) const;
  bool is_behind_a_solid(std::size_t layer, int frame) const;
  void name_objects();
  void open_geometry(std::size_t layer);
  bool shows_in(std::size_t layer, const std::optional<std::vector<int>>& frames) const;

  std::filesystem::path shot_file_, cache_folder_, folder_;
  TakeHosts* hosts_;
  ShotDocument shot_;
  ShotCamera camera_;
  ShotColors colors_;
  std::vector<std::vector<Clip>> clips_;
  std::vector<std::unique_ptr<const LightFieldLayer>> light_fields_;
  std::unique_ptr<Textures> textures_;  ///< null: no mesh is visible
  std::vector<std::unique_ptr<const GeometryLayer>> geometries_;
  std::vector<std::unique_ptr<const PlateLayer>> plates_;
  std::vector<std::vector<std::string>> object_names_;
  Lights lights_;
  std::string lights_print_;
  std::vector<LayerLight> layer_lights_;
};

}  // namespace raystage
