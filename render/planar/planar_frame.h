// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "render/common/contribution.h"
#include "render/common/plane_projection.h"
#include "render/common/ray_cells.h"
#include "render/planar/view_rows.h"
#include "render/sampling/source_frames.h"

namespace raystage::render {

/// Renders one view whose rays are looked up in the array's cells, in stages: plan (which source
/// pixels), decode, blend. Keeps references to `view` and `instant`.
class PlanarFrame {
 public:
  PlanarFrame(const VirtualCamera& view, const LightFieldFrame& instant,
              const Eigen::Vector4d& plane, const ViewRegion* region, bool count_needed);
  virtual ~PlanarFrame() = default;
  PlanarFrame(const PlanarFrame&) = delete;
  PlanarFrame& operator=(const PlanarFrame&) = delete;

  RenderedView render();
  /// Returns the contribution of this rank's cameras: sums, one plane.
  Contribution contribute();
  /// Returns the view for `sums`, the sum of all ranks' contributions.
  RenderedView combine(PixelValues sums);

 protected:
  /// Sets used_, and what blend_span() needs.
  virtual void find_cameras() = 0;
  /// Marks the source pixels that rows [first, end) read.
  virtual void mark_rows(int first, int end) = 0;
  /// Returns whether this rank has a frame of a camera that may contribute to rays through a cell.
  virtual bool has_frame(const RayCells::Span& span) = 0;
  /// Writes the pixels of a span: four values each in `rgba`, one each in `coverage` and `z`, which
  /// may be null with SumStage::kSampleOnly.
  virtual void blend_span(const RayCells::Span& span, int y, float full_scale, float* rgba,
                          float* coverage, float* z, SumStage sums) = 0;
  /// Fills in the rest of a blended view.
  virtual void complete(RenderedView& image) const = 0;
  /// Returns the view from a point on the plane.
  virtual RenderedView transparent_view() const { return empty_view(view_); }

  /// Returns the run of a span, without its sources.
  PixelRun run_in_cell(const RayCells::Span& span, int y) const;

  const VirtualCamera& view_;
  const LightFieldFrame& instant_;
  PlaneProjection projection_;
  RayCells cells_;
  ViewRows rows_;
  SourceFrames sources_;
  std::vector<bool> used_;  // per camera of the rig: contributes to a ray

 private:
  bool is_eye_on_plane() const { return !projection_.at_infinity() && projection_.distance() == 0; }
  /// Plans and decodes; returns the time when both were done.
  RenderClock::time_point decode(RenderStatistics& statistics);
  void mark_needed();
  void blend(RenderedView& image, SumStage sums);
};

}  // namespace raystage::render
