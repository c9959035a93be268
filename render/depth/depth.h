// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>

#include "render/common/blending_field.h"
#include "render/common/method.h"
#include "render/common/world_ray.h"
#include "render/depth/camera_depths.h"
#include "render/depth/fusion.h"
#include "render/sampling/depth_sampling.h"

namespace raystage {

/// Method "depth": a depth for every pixel of every camera, found once per instant with all
/// cameras' evidence and kept; a view's depths are what its nearest cameras agree on, and its
/// pixels the mean of the cameras that see the point, where nothing hides it from them, less of
/// those that differ from the rest (design, ReconstructionSettings).
///
/// A = the shares of the chosen cameras that see the pixel's point, over kFullAlphaWeight and 1 at
/// most. Coverage is lower than that by the shares of cameras that would have been chosen had they
/// a frame at this instant. z: planar depth of the point found. Throws Error (bad input) where
/// neither the take nor the options say how deep the scene is.
const Method& depth_method();

/// What finding depths took; nothing where they are kept already.
struct DepthEstimationStatistics {
  std::size_t bytes = 0;            ///< worked in, the most at once
  std::int64_t pixels_decoded = 0;  ///< of the cameras' frames, summed
};

namespace depth {

struct DepthViewSettings {
  DepthEstimationSettings estimation;
  int cameras = 16;
  double agreement = 10;  ///< codes of 255
  Interpolation look_up = Interpolation::kCubic;
  bool keep = true;       ///< in the take's folder
  bool temporal = false;  ///< depths steadied by those of LightFieldFrame::adjacent_frames
};

/// What is to be done for a view: shared by the fast and the slow way.
struct DepthViewPlan {
  DepthViewSettings settings;
  VirtualCamera pinhole;    ///< the view, without its lens distortion
  InverseDepthRange range;  ///< of what it sees
  BlendingField field;
  std::optional<BlendingField> complete;  ///< as if no camera were absent; only where one is
  std::shared_ptr<const CameraDepths> depths;
  InverseDepthMap view_depths;     ///< of the pinhole's pixels; all known
  std::vector<std::string> notes;  ///< see RenderedView::notes
  DepthEstimationStatistics work;  ///< that it took: see RenderStatistics
};
/// nullopt where the view sees nothing of the scene.
std::optional<DepthViewPlan> plan(const ViewRequest& request);

// The parts of a plan, for hosts that make it together.

/// All of it but the depths of cameras and view.
std::optional<DepthViewPlan> plan_without_depths(const ViewRequest& request);
/// The cameras whose depths are voted on, by index in the rig, and how.
struct FusionInputs {
  std::vector<DepthHypotheses> hypotheses;  ///< without a map where the plan has none of the camera
  std::vector<int> cameras;                 ///< of each report, increasing
  FusionSettings settings;
};
FusionInputs fusion_inputs(const DepthViewPlan& plan, const ViewRequest& request);
/// What no camera knows lies behind everything.
void fill_unknown_depths(const DepthViewPlan& plan, InverseDepthMap& view_depths);
/// Names what an instant's depths depend on, besides the take.
std::string depth_cache_key(const LightFieldFrame& instant,
                            const DepthEstimationSettings& settings);
/// What people should know about the depths of an instant's cameras; reads no maps.
std::vector<std::string> depth_notes(const CameraDepths& depths, const LightFieldFrame& instant,
                                     const DepthEstimationSettings& settings);

/// The depths of an instant's cameras as the method has them with its options as they are unless
/// told, but between these depths of the `scene`: kept likewise, in `kept` and, with `keep`, in the
/// take. `work`: what they took, where they are found now, is added to it.
std::shared_ptr<const CameraDepths> depths_with_default_options(const LightFieldFrame& instant,
                                                                ResultCache& kept,
                                                                std::size_t working_bytes,
                                                                bool keep, const DepthRange& scene,
                                                                DepthEstimationStatistics& work);

/// Where any ray meets what the method finds with these `options` of its own, kept and taken from
/// where its views' depths are (see depth_surface); `instant`'s rig must live on. Throws Error (bad
/// input) as the method does.
RaySurface depth_method_surface(const MethodOptions& options, const LightFieldFrame& instant,
                                ResultCache& kept, std::size_t working_bytes, bool use_take_folder);

/// What share of a pixel cameras have that are absent, 0 to 1.
float absent_camera_weight(const DepthViewPlan& plan, const LightFieldFrame& instant, int x, int y);

/// By how much, 1/m along the view's axis, a camera's depth may be nearer than a point that it
/// sees.
float visibility_tolerance(const DepthViewPlan& plan);

/// How far a camera sees a point by its own depths, 0 to 1, in double: see VisibilityRun. The point
/// lies along `towards` from the camera's centre (in the world; times `inverse_depth`, its inverse
/// planar depth in the view, 1/m).
double point_visibility(const DepthViewPlan& plan, int camera, const Eigen::Vector3d& towards,
                        double inverse_depth);

/// Fills RenderedView::cameras and nearest_ray.
void measure_coverage(const ViewRequest& request, const DepthViewPlan& plan, RenderedView& image);

RenderedView render(const ViewRequest& request);
RenderedView render_reference(const ViewRequest& request);

}  // namespace depth
}  // namespace raystage
