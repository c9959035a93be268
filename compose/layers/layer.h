// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "compose/exr/exr_header.h"
#include "compose/layers/fingerprint.h"
#include "compose/layers/layer_image.h"
#include "compose/layers/rotten_cameras.h"
#include "render/renderer.h"
#include "store/rotten_frame.h"

namespace raystage::compose {

class GeometryLayer;
struct GeometryScene;
class LightFieldLayer;

/// What to show at a shot frame for which a take has no light field frame (as OpenTimelineIO).
enum class MissingFrames {
  kError,  ///< fail before anything is rendered
  kHold,   ///< show the nearest earlier instant, or else the nearest later one
  kBlack   ///< show a frame with alpha and coverage 0
};

/// Times within the exposure of a frame are multiples of this part of a frame away from it, so that
/// they can be numbered.
inline constexpr int kOffsetsPerFrame = 1024;

/// The instant of a take that a frame of the shot shows.
struct ShownTick {
  /// Index into Timeline::ticks, or beyond for an exact time between them; none: nothing.
  std::optional<int> tick;
  bool held = false;  ///< a nearest instant replaces a missing one
};

/// Memory budget of a light field, bytes.
struct LightFieldMemory {
  std::size_t cache = 0;         ///< decoded source frames
  std::size_t result_cache = 0;  ///< results that the method caches
  std::size_t working = 0;       ///< working memory of one frame in flight
};

/// Settings that all layers of a sequence share, except `memory`.
struct LayerRendererOptions {
  LightFieldMemory memory;
  bool measure_coverage = false, measure_confidence = false;  ///< as RendererOptions
  std::filesystem::path cache_folder;                         ///< as RendererOptions
  std::shared_ptr<render::StoredDataCounts> stored_data_counts;
  render::DistributedTakes* hosts = nullptr;  ///< null: the take's folder holds its archives
  store::RottenFrames rotten_frames = store::RottenFrames::kAbsent;  ///< as RendererOptions
};

/// What previews give up for speed.
struct PreviewOptions {
  /// Replaces the method of light fields that show all they see, with its default options; empty:
  /// each has its own.
  std::string method = {};
  int max_supersampling = 64;  ///< of light fields, as render::ReconstructionOptions
};

/// One view of a frame, as a layer renders it.
struct LayerView {
  int frame = 0;
  const ShownTick& shown;
  const ExrCamera& camera;
  const GeometryScene* scene = nullptr;    ///< all meshes of the frame; null: none is needed
  int mesh = -1;                           ///< index of the layer's mesh in it; -1: none
  std::span<const float> object_ids = {};  ///< for LayerImage::ids; empty: not requested
  PreviewOptions preview = {};
  RottenCameras* rotten_cameras = nullptr;  ///< receives those of the view; null: not collected
  double offset = 0;                        ///< within the exposure, frames from the frame
  std::vector<render::VirtualCamera> shown_views = {};  ///< as ReconstructionOptions

  double time() const { return frame + offset; }  ///< frames
};

/// Answers single rays of a layer that is a light.
struct LayerRays {
  std::function<void(std::span<const render::WorldRay>, std::span<render::RaySample>)> query;
  Eigen::Vector3d viewing_direction;  ///< mean of the array's cameras, world
};

/// Renders a layer in the frames of a sequence. Thread-safe.
class LayerRenderer {
 public:
  LayerRenderer() = default;
  virtual ~LayerRenderer() = default;
  LayerRenderer(const LayerRenderer&) = delete;
  LayerRenderer& operator=(const LayerRenderer&) = delete;

  /// Returns false only if the layer is certainly not visible in the view. Cheap.
  virtual bool may_show(const LayerView& /*view*/) const { return true; }
  /// Renders the layer without clips and opacity. Throws Error (bad input) for unreadable files.
  virtual LayerImage render(const LayerView& view) const = 0;
  /// Returns access to single rays at a frame; none if the layer shows nothing or has no rays.
  virtual std::optional<LayerRays> rays(const LayerView& /*view*/) const { return std::nullopt; }

  /// Requests the source data of a later render() from the disk.
  virtual void read_ahead(const ShownTick& /*shown*/) const {}
  /// Return statistics as LightFieldRenderer defines them.
  virtual int frames_read_ahead() const { return 0; }
  virtual store::DecodeCosts decode_costs() const { return {}; }
  virtual std::size_t decoded_bytes_cached() const { return 0; }
};

/// The stage of a frame that the time of a layer counts for.
enum class LayerStage { kLightFields, kGeometry, kMerge };

/// Arguments of Layer::check_frame().
struct LayerFrameCheck {
  int frame = 0;
  const ShownTick& shown;
  bool is_visible = true;
  bool camera_has_focus = false;
  std::set<std::filesystem::path>& files_checked;  ///< skip these: frames may share a plate
};

/// A layer of a shot: opened, and checked as far as possible before rendering.
class Layer {
 public:
  Layer() = default;
  virtual ~Layer() = default;
  Layer(const Layer&) = delete;
  Layer& operator=(const Layer&) = delete;

  /// Checks the layer's inputs at a frame. Throws Error (bad input) if a file that it reads is
  /// missing or unusable, or if the camera lacks a property that it needs.
  virtual void check_frame(const LayerFrameCheck& /*check*/) const {}
  /// Adds what determines the layer's pixels at a frame, or a time within its exposure, except
  /// properties of all kinds of layers.
  virtual void add_to_fingerprint(Fingerprint& /*print*/, double /*frame*/,
                                  const ShownTick& /*shown*/) const {}
  /// Fills in the layer's metadata for the header of a frame. Returns false if it has none.
  virtual bool fill_metadata(const ShownTick& /*shown*/, ExrMetadata& /*metadata*/) const {
    return false;
  }
  /// Returns the file that the layer reads at the frame, which rendering must not overwrite.
  virtual std::optional<std::filesystem::path> input_file(int /*frame*/) const {
    return std::nullopt;
  }
  /// Returns the Cryptomatte names of the layer's objects. `layer`: the layer's name.
  virtual std::vector<std::string> object_names(const std::string& layer) const { return {layer}; }

  /// Returns the memory that all frames share, bytes.
  virtual std::size_t shared_bytes() const { return 0; }
  /// Returns the memory that each frame in flight adds, whatever its size, bytes.
  virtual std::size_t frame_bytes() const { return 0; }
  /// Returns the memory of the layer's AOVs in a view, bytes per pixel.
  virtual std::size_t aov_bytes_per_pixel() const { return 0; }

  /// Returns the layer if it has a take, and else null.
  virtual const LightFieldLayer* as_light_field() const { return nullptr; }
  /// Returns the layer if it has a mesh, and else null.
  virtual const GeometryLayer* as_geometry() const { return nullptr; }

  virtual LayerStage stage() const { return LayerStage::kMerge; }
  /// Returns whether the colours are in kSceneSpace; otherwise they are in the working space.
  virtual bool is_in_scene_space() const { return false; }
  /// Returns whether transparent pixels are rays that no camera saw.
  virtual bool is_transparent_where_unseen() const { return false; }

  /// Returns a renderer, which keeps a reference to this layer.
  virtual std::unique_ptr<const LayerRenderer> make_renderer(
      const LayerRendererOptions& options) const = 0;
};

}  // namespace raystage::compose
