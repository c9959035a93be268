// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <stop_token>
#include <vector>

#include "compose/layers/deep_image.h"
#include "compose/layers/layer.h"
#include "compose/layers/layer_image.h"
#include "compose/layers/layer_surfaces.h"
#include "compose/sequence_memory_plan.h"
#include "compose/shot_plan.h"

namespace raystage::compose {

/// Wall-clock time of a view by stage, measured in the thread of its frame. That of geometry is
/// divided as all threads divide theirs between its rays and light fields that are lights.
struct CompositingTimes {
  double light_fields_ms = 0;  ///< also as lights of the geometry
  double geometry_ms = 0;      ///< also its shadows on light fields
  double merge_ms = 0;         ///< and everything else: plates, clips, colours
  void add(const CompositingTimes& other) {
    light_fields_ms += other.light_fields_ms;
    geometry_ms += other.geometry_ms;
    merge_ms += other.merge_ms;
  }
  /// Adds the time of a layer; merge_ms is the rest of the total.
  void add(LayerStage stage, double ms) {
    if (stage == LayerStage::kLightFields) light_fields_ms += ms;
    if (stage == LayerStage::kGeometry) geometry_ms += ms;
  }
};

struct CompositedView {
  LayerImage picture;
  CompositingTimes times;
  /// For each layer: share of the view's pixels that no camera saw; 0 for layers whose transparency
  /// is intended (mattes, hulls).
  std::vector<double> uncovered_share = {};
  std::vector<std::string> rotten_cameras = {};  ///< ids: see RottenCameras
};

/// Renders, clips and merges the layers of frames. Thread-safe. Keeps a reference to the plan.
class FrameCompositor {
 public:
  FrameCompositor(const ShotPlan& plan, const SequenceMemoryPlan& memory);

  /// Returns one view, with the same AOVs at every frame. Layers are rendered from the front; in
  /// layer order, those behind an opaque composite are skipped. After `stop` is requested the
  /// remaining layers are skipped. `deep`: if not null, receives the samples of the view.
  CompositedView composite(const PlannedFrame& frame, const ExrCamera& camera,
                           const std::stop_token& stop, DeepImage* deep = nullptr) const;
  /// Returns a view of the shot's camera, averaged over the frame's exposure (ExposureAverage); it
  /// ends early where more times change nothing. `deep` receives the samples of its middle.
  CompositedView composite_exposure(const PlannedFrame& frame, Eye eye, const std::stop_token& stop,
                                    DeepImage* deep = nullptr) const;

  /// Requests the source frames of a frame from the disk.
  void read_ahead(const PlannedFrame& frame) const;
  int frames_read_ahead() const;
  std::size_t decoded_bytes_cached() const;
  store::DecodeCosts decode_costs() const;
  /// Returns counts over all light fields and all views rendered so far.
  const render::StoredDataCounts& stored_data() const { return *stored_data_; }

 private:
  /// What the layers of a frame record together: the work of one stage for the other one, and
  /// cameras.
  struct SharedRecord {
    std::atomic<std::int64_t> light_queries_ns = 0;  ///< of all threads, for geometry
    std::atomic<std::int64_t> geometry_ns = 0;       ///< of all threads, with these queries
    RottenCameras rotten_cameras;
    double shadows_ms = 0;  ///< of geometry on light fields, in the thread of the frame
  };
  /// The geometry of a frame; `mesh_indices` as ShotPlan::geometry_at.
  struct Geometry {
    GeometryScene scene;
    std::vector<int> mesh_indices;
    std::shared_ptr<SharedRecord> record;
  };
  /// Returns a view in the working space, without the AOVs that no layer has.
  CompositedView merged_view(const PlannedFrame& frame, const ExrCamera& camera,
                             const std::stop_token& stop, DeepImage* deep) const;
  /// Converts a merged view to that of files.
  void finish(LayerImage& image, DeepImage* deep) const;
  /// Returns an empty geometry if no mesh is in view and none casts shadows on a light field.
  Geometry geometry_in_frame(const PlannedFrame& frame, const ExrCamera& camera) const;
  LayerView layer_view(std::size_t layer, const PlannedFrame& frame, const ExrCamera& camera,
                       const Geometry& geometry, std::span<const float> object_ids = {}) const;
  /// Returns the radiance of rays that leave the geometry: light fields, then `behind`.
  EnvironmentRadiance environment_of(const PlannedFrame& frame, const ExrCamera& camera,
                                     const Lights& behind,
                                     const std::shared_ptr<SharedRecord>& record) const;
  /// `uncovered_share`: receives the share of the layer's pixels that no camera saw.
  /// `separates`: at edges of depth both surfaces of the layer are wanted.
  LayerSurfaces render_layer(std::size_t layer, const PlannedFrame& frame, const ExrCamera& camera,
                             const Geometry& geometry, bool separates,
                             double& uncovered_share) const;
  /// Renders the visible layers of the `count` up to `foremost`, which surround one volume.
  LayerImage render_volume(std::size_t foremost, std::size_t count, const PlannedFrame& frame,
                           const ExrCamera& camera, const Geometry& geometry) const;
  /// Returns the radiance of a light of one layer, or several around a volume, over `behind`.
  EnvironmentRadiance layer_light_radiance(const ShotPlan::LightFieldLight& light,
                                           const PlannedFrame& frame, const ExrCamera& camera,
                                           EnvironmentRadiance behind,
                                           const Eigen::Vector3f& ambient,
                                           const std::shared_ptr<SharedRecord>& record) const;
  /// Applies clips, opacity and the layer's object id to its surfaces.
  void apply_layer_settings(std::size_t layer, const ExrCamera& camera, bool has_clips,
                            LayerSurfaces& surfaces) const;
  /// Converts from kSceneSpace.
  void convert_to_working_space(LayerImage& image) const;
  /// Removes AOVs that the files do not contain.
  void remove_unrequested_aovs(LayerImage& image) const;
  /// Returns the Cryptomatte ids of the layer's objects; none unless requested.
  std::vector<float> cryptomatte_ids(std::size_t layer) const;
  /// Converts the picture, its colour AOVs and its deep samples.
  void convert_to_output_space(LayerImage& image, DeepImage* deep) const;
  double uncovered_share_of_layer(std::size_t layer, const LayerImage& image) const;
  /// Adds requested AOVs that no layer of this frame has.
  void add_missing_aovs(LayerImage& image) const;

  const ShotPlan& plan_;
  std::shared_ptr<render::StoredDataCounts> stored_data_;
  std::vector<std::unique_ptr<const LayerRenderer>> renderers_;  ///< of each layer
};

}  // namespace raystage::compose
