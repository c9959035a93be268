// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "compose/camera/shot_camera.h"
#include "compose/draft_shot.h"
#include "compose/exr/exr_header.h"
#include "compose/geometry/geometry_layer.h"
#include "compose/geometry/geometry_scene.h"
#include "compose/layers/clip.h"
#include "compose/layers/layer.h"
#include "compose/layers/light_field_layer.h"
#include "compose/shot_color_spaces.h"
#include "compose/shown_views.h"
#include "render/distributed_rendering.h"
#include "schemas/hole_fill.h"
#include "schemas/shot_document.h"
#include "store/rotten_frame.h"

namespace raystage::compose {

/// Raised whenever the same inputs give other pixels, so that existing files count as out of date.
inline constexpr int kReconstructionVersion = 14;

/// A frame of the shot, or a time within its exposure, with the instants that it shows.
struct PlannedFrame {
  int frame = 0;
  std::vector<ShownTick> shown;  ///< for each layer; none for layers without a take
  PreviewOptions preview = {};
  double offset = 0;  ///< within the exposure, frames from the frame
  /// Of 2^n + 1 times from the opening of the shutter to its closing, frames from the frame; empty:
  /// no motion blur.
  std::vector<double> exposure = {};
  /// Of all frames of the shot; null: any view may be shown. Refers to the plan.
  std::shared_ptr<const ShownViews> shown_views = nullptr;

  /// Returns the views that the shot shows of the layer's light field frame; see ShownViews.
  std::vector<render::VirtualCamera> views_shown(std::size_t layer) const {
    if (!shown_views || !shown[layer].tick) return {};
    return shown_views->of(layer, *shown[layer].tick);
  }

  double time() const { return frame + offset; }  ///< frames
};

/// Whether frames are averaged while the shutter is open. kNone also allows other views than the
/// shot's, as a viewer shows them: PlannedFrame::shown_views is null.
enum class MotionBlur { kOfShot, kNone };

/// Settings that replace or extend those of the shot.
struct ShotPlanOptions {
  std::optional<schemas::HoleFill> fill = {};
  /// Not empty: the method `auto` with these options for every light field.
  schemas::OptionValues target = {};
  DraftOptions draft = {};
  store::RottenFrames rotten_frames = store::RottenFrames::kAbsent;  ///< as RendererOptions
  std::string layout = "";                  ///< not empty: of the EXR files
  std::filesystem::path color_config = {};  ///< not empty: OpenColorIO's
  std::vector<std::string> aovs = {};       ///< in addition to those of the shot
  /// Only layers that are visible in one of these frames are opened; none: all frames of the shot.
  std::optional<std::vector<int>> frames = {};
  /// Holds the data that methods derive from takes (DIR/depth/...); empty: each take's folder does.
  /// Does not change the pixels, nor the fingerprint.
  std::filesystem::path cache_folder = {};
  std::size_t memory_bytes = 0;  ///< that the shot may need; 0: half of the machine's
  /// Folder that paths in the shot are relative to; empty: that of the shot file.
  std::filesystem::path folder = {};
  /// Whether a camera whose archive is missing counts as absent; otherwise it is an error.
  bool accepts_missing_archives = false;
  /// Access to archives on other hosts; null: each take's folder holds them. Referred to.
  render::DistributedTakes* hosts = nullptr;
};

/// A shot whose visible layers are opened and checked as far as possible before rendering.
class ShotPlan {
 public:
  /// Throws Error (bad input) if the shot, its camera or a layer cannot be used, or if compression
  /// or layout is unknown.
  explicit ShotPlan(const std::filesystem::path& shot_file, const ShotPlanOptions& options = {});
  /// Plans a shot that is in memory. `shot_file`: where it is or would be. Throws likewise.
  ShotPlan(const schemas::ShotDocument& shot, const std::filesystem::path& shot_file,
           const ShotPlanOptions& options);

  const schemas::ShotDocument& shot() const { return shot_; }
  std::size_t layers() const { return shot_.layers.size(); }
  /// Returns the error of a layer's file so that it names the layer, too.
  Error error_of_layer(std::size_t layer, const Error& error) const;
  /// Returns a layer; null: it shows nothing.
  const Layer* layer(std::size_t layer) const { return layers_[layer].get(); }
  /// Returns a layer with a take; null: it is of another kind, or shows nothing.
  const LightFieldLayer* light_field(std::size_t layer) const {
    return layers_[layer] ? layers_[layer]->as_light_field() : nullptr;
  }
  /// Returns all layers with a take that show something, in the order of the layers.
  std::vector<const LightFieldLayer*> light_fields() const;
  /// Returns a layer with a mesh; null: it is of another kind, or shows nothing.
  const GeometryLayer* geometry(std::size_t layer) const {
    return layers_[layer] ? layers_[layer]->as_geometry() : nullptr;
  }
  /// Returns all meshes that are visible at a frame, at its time, and their lights. `mesh_indices`:
  /// receives for each layer the index of its mesh in the result, or -1.
  GeometryScene geometry_at(const PlannedFrame& frame, std::vector<int>& mesh_indices) const;
  /// Returns the Cryptomatte names of a layer's objects, "LAYER/OBJECT" for meshes and "LAYER" for
  /// others; none unless requested.
  const std::vector<std::string>& object_names(std::size_t layer) const {
    return object_names_[layer];
  }
  /// Returns the memory that all frames share, bytes: meshes, at most their textures, mattes.
  std::size_t shared_bytes() const;
  std::span<const Clip> clips(std::size_t layer) const { return clips_[layer]; }
  /// Returns whether a layer may be visible at a frame: within its range, not fully transparent or
  /// clipped, not behind an opaque solid.
  bool is_visible(std::size_t layer, int frame) const;
  /// Returns whether a layer is used at a frame: visible, or a light on visible geometry.
  bool is_needed(std::size_t layer, int frame) const;
  /// A light field that is a light: one layer, or those around a volume.
  struct LightFieldLight {
    std::vector<std::size_t> layers;
    double strength = 1;
  };
  const std::vector<LightFieldLight>& light_field_lights() const { return light_field_lights_; }
  /// Returns whether a light field is a light.
  bool is_light(std::size_t layer) const;
  /// Returns the number of layers of the volume whose foremost layer this is; 1 without a volume.
  std::size_t volume_layer_count(std::size_t layer) const;

  const ShotColorSpaces& colors() const { return colors_; }
  store::RottenFrames rotten_frames() const { return rotten_frames_; }
  /// Returns ShotPlanOptions::cache_folder.
  const std::filesystem::path& cache_folder() const { return cache_folder_; }
  render::DistributedTakes* hosts() const { return hosts_; }
  /// Returns whether the files contain an AOV (ShotDocument::Output::aovs).
  bool writes_aov(std::string_view aov) const;
  /// Returns whether they contain one that needs RendererOptions::measure_coverage.
  bool measures_coverage() const;

  /// Returns the views of a frame: left and right, or one.
  std::vector<Eye> eyes() const { return camera_.eyes(); }
  const ShotCamera& shot_camera() const { return camera_; }
  /// Returns the camera with overscan.
  render::VirtualCamera camera(double frame, Eye eye) const { return exr_camera(frame, eye).view; }

  /// Returns the instants that the frames show, also while the shutter is open. With kError throws
  /// Error (bad input), which lists the frames for which a take has no instant.
  std::vector<PlannedFrame> plan(std::span<const int> frames, MissingFrames policy,
                                 MotionBlur blur = MotionBlur::kOfShot) const;
  /// Returns the frame at the times of its exposure, from first to last.
  std::vector<PlannedFrame> exposure_of(const PlannedFrame& frame) const;

  /// Throws Error (bad input) if a file that a layer reads for one of the frames is missing, or if
  /// the camera has no position.
  void check_files(std::span<const PlannedFrame> frames) const;

  /// Returns the hash of everything that determines the file of a frame: camera, layers, size and
  /// output of the shot, take.json, rig.json and kReconstructionVersion. It includes time and XXH3
  /// of each source frame, also those of adjacent ticks if the method reads them. Paths, threads
  /// and other frames are not included.
  std::string fingerprint(const PlannedFrame& frame, bool chromaticities) const;
  /// Returns the header of a frame. Take and method are those of the first visible light field.
  ExrMetadata metadata(const PlannedFrame& frame) const;
  ExrCamera exr_camera(double frame, Eye eye) const;  ///< with adjacent views for the AOV `motion`

 private:
  void find_light_field_lights();
  void add_exposure_sample(const PlannedFrame& sample, Fingerprint& print) const;
  ExrCamera exr_camera_at(double frame, Eye eye) const;
  bool is_shown(std::size_t layer, int frame) const;
  bool is_occluded_by_solid(std::size_t layer, int frame) const;
  void assign_object_names();
  std::unique_ptr<const Layer> open_layer(std::size_t layer, const ShotPlanOptions& options);
  std::unique_ptr<const Layer> open_light_field(std::size_t layer, const ShotPlanOptions& options);
  std::unique_ptr<const Layer> open_geometry(std::size_t layer);
  bool is_visible_in_any(std::size_t layer, const std::optional<std::vector<int>>& frames) const;

  store::RottenFrames rotten_frames_ = store::RottenFrames::kAbsent;
  std::filesystem::path shot_file_, cache_folder_, folder_;
  render::DistributedTakes* hosts_;
  std::size_t memory_bytes_;
  schemas::ShotDocument shot_;
  ShotCamera camera_;
  ShotColorSpaces colors_;
  std::vector<std::vector<Clip>> clips_;
  std::unique_ptr<Textures> textures_;                ///< null: no mesh is visible
  std::vector<std::unique_ptr<const Layer>> layers_;  ///< null: it shows nothing
  std::vector<std::vector<std::string>> object_names_;
  Lights lights_;
  std::string lights_fingerprint_;
  std::vector<LightFieldLight> light_field_lights_;
};

}  // namespace raystage::compose
