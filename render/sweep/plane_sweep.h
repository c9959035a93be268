// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "matching/matching.h"
#include "render/common/blending_field.h"
#include "render/common/method.h"
#include "render/sampling/depth_sampling.h"

namespace raystage::render {

/// Returns the method "plane_sweep" (Yang et al. 2002; Zhang and Chen 2004; thesis,
/// Reconstruction). It tries planes across the view, evenly spaced in inverse depth. At each pixel
/// it selects the plane on which the cameras agree best, smoothed by semi-global matching. Then it
/// blends the cameras that see that point, weighted by angle and field of view (README.md compares
/// them with the lumigraph's).
///
/// A = the weights of the selected cameras that see the pixel's point. Coverage is A less the
/// weights of cameras that would be selected but have no frame at this instant. z: planar depth of
/// the point. Throws Error (bad input) if neither take nor options give the depth range.
const Method& plane_sweep_method();

namespace plane_sweep {

enum class Aggregation { kSemiGlobal, kBox, kNone };

struct PlaneSweepOptions {
  int cameras = 4;
  Aggregation aggregation = Aggregation::kSemiGlobal;
  Interpolation interpolation = Interpolation::kCubic;  ///< of source frames
  bool subplane_refinement = true;
  int p1 = 40, p2 = 800, box_radius = 2;
  double truncation = 40;
  int excluded_cameras = 0;
  double edge_scale = 0;  ///< codes; 0: no edge guide
  bool is_valid(std::string* reason) const;
};

/// The inputs of rendering a view, for render() and render_reference().
struct PlaneSweepPlan {
  PlaneSweepOptions settings;
  BlendingField field;
  std::optional<BlendingField> complete;  ///< as if no camera were absent; set only if one is
  SweepPlanes planes;
  std::vector<std::string> notes;  ///< see RenderedView::notes
};
/// Returns the settings of the aggregation. `guide`: see SemiGlobalOptions; empty: no edge_scale.
matching::SemiGlobalOptions semi_global_options(const PlaneSweepOptions& settings,
                                                std::span<const std::uint8_t> guide);
/// Returns the plan, or nullopt if the view sees nothing of the scene.
std::optional<PlaneSweepPlan> plan(const ViewRequest& request);

RenderedView render(const ViewRequest& request);
RenderedView render_reference(const ViewRequest& request);

}  // namespace plane_sweep
}  // namespace raystage::render
