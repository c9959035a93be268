// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <stop_token>
#include <vector>

#include "compose/layers/deep_samples.h"
#include "compose/layers/layer_image.h"
#include "compose/memory_plan.h"
#include "compose/shot_plan.h"
#include "render/renderer.h"

namespace raystage {

/// Where a view's time went: wall-clock, of the thread that has its frame; others help.
struct PaintTimes {
  double light_fields_ms = 0, geometry_ms = 0;
  double merge_ms = 0;  ///< and all else: plates, clips, colours
};

struct PaintedView {
  LayerImage picture;
  PaintTimes times;
  /// Of each layer: the part of the view that none of its light field's cameras saw; 0 where that
  /// is meant so (mattes, hulls).
  std::vector<double> unseen = {};
};

/// Paints the views of a shot's frames: every layer, cut and faded as the shot says, merged. Many
/// threads may paint at once. `plan` must live on.
class FramePainter {
 public:
  FramePainter(const ShotPlan& plan, const MemoryPlan& memory);

  /// One view, with the same AOVs at every frame. Layers are rendered from the front; where the
  /// shot states their order, and those in front hide all, the others are left alone. What remains
  /// once `stop` is requested is not painted. `deep`: not null, becomes the samples that the view
  /// is made of.
  PaintedView paint(const PlannedFrame& frame, const ExrCamera& camera, const std::stop_token& stop,
                    DeepImage* deep = nullptr) const;

  /// Asks the disk for what a frame will need.
  void read_ahead(const PlannedFrame& frame) const;
  int frames_read_ahead() const;
  std::size_t decoded_bytes_held() const;
  DecodeCosts decode_costs() const;
  /// Counts over all light fields and all views painted so far.
  const StoredDataCounts& stored_data() const { return *stored_data_; }

 private:
  /// The geometry of a frame; `mesh_of_layer` as ShotPlan::geometry_at.
  struct Geometry {
    GeometryScene scene;
    std::vector<int> mesh_of_layer;
  };
  /// Nothing where no mesh is in view and none throws shadows on a light field.
  Geometry geometry_of(const PlannedFrame& frame, const ExrCamera& camera) const;
  /// Whether a layer of geometry may show.
  bool is_in_view(const Geometry& geometry, std::size_t layer, const ExrCamera& camera) const;
  /// What rays see that leave the geometry: light fields, then what `behind` says.
  Surroundings surroundings_of(const PlannedFrame& frame, const ExrCamera& camera,
                               const Lights& behind) const;
  LayerImage layer_image_of(std::size_t layer, const PlannedFrame& frame, const ExrCamera& camera,
                            const Geometry& geometry) const;
  /// Of `count` layers up to `foremost` that stand around one volume, those that are visible.
  LayerImage volume_image_of(std::size_t foremost, std::size_t count, const PlannedFrame& frame,
                             const ExrCamera& camera, const Geometry& geometry) const;
  /// What rays see of a light that is one layer or more around a volume; none: nothing now.
  Surroundings light_of(const ShotPlan::LayerLight& light, const PlannedFrame& frame,
                        const ExrCamera& camera, Surroundings behind,
                        const Eigen::Vector3f& ambient) const;
  /// From kSceneSpace, as light fields and plates bring it.
  void turn_into_working_colors(LayerImage& image) const;
  /// AOVs that the files do not tell need not be merged.
  void drop_unwanted(LayerImage& image) const;
  /// Cryptomatte's, of the layer's objects; none where nobody asks.
  std::vector<float> ids_of(std::size_t layer) const;
  /// Of the picture, its colour AOVs and samples.
  void turn_into_file_colors(LayerImage& image, DeepImage* deep) const;
  double unseen_of(std::size_t layer, const LayerImage& image) const;
  /// Adds what other frames have and this one does not.
  void complete(LayerImage& image) const;

  const ShotPlan& plan_;
  std::shared_ptr<StoredDataCounts> stored_data_;
  std::vector<std::unique_ptr<const LightFieldRenderer>> renderers_;  ///< of each layer
};

}  // namespace raystage
