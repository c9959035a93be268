// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "render/common/blending_field.h"
#include "render/sampling/depth_sampling.h"

namespace raystage::render {

/// The cameras of a view's blending field that this host holds: where they see the view's points,
/// and their frames, decoded where the view reads them.
class FieldSources {
 public:
  struct Source {
    DepthSource source;  ///< its rgba stays null if nothing of the camera is seen
    store::McuMask wanted;
    std::shared_ptr<const store::DecodedFrame> frame;  ///< null: not read
    bool used = false;
  };

  /// Determines the cameras and which of their pixels are read. `depths`: the range of each tile of
  /// the field, relative to `reference` (1/m, see depth_source()). Keeps a reference to `instant`.
  /// Throws Error (bad input) if a frame cannot be read.
  FieldSources(const VirtualCamera& view, const LightFieldFrame& instant,
               const BlendingField& field, std::span<const InverseDepthRange> depths,
               double reference, Interpolation interpolation);
  /// Sets `pixels_decoded` and `cameras_used`.
  void decode(RenderStatistics& statistics);

  const Source& operator[](std::size_t camera) const { return sources_[camera]; }
  std::size_t size() const { return sources_.size(); }  ///< cameras of the rig

  /// Returns the number of distinct source pixels that `mark` marks with mark_samples_at_depth().
  /// mark(camera, source) is called in parallel for each decoded camera.
  std::int64_t count_marked_pixels(
      const std::function<void(int camera, const DepthSource& source)>& mark) const;

 private:
  /// Returns the cameras that are used, the facets of a fisheye, which share its frame, together.
  std::vector<std::vector<std::size_t>> sources_by_frame() const;

  const LightFieldFrame& instant_;
  std::vector<Source> sources_;
};

/// Returns the camera's weights in the tile, or null if it has none.
const BlendingField::TileCamera* find_camera(const BlendingField::Tile& tile, int camera);

}  // namespace raystage::render
