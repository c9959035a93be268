// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>

#include "render/common/blending_field.h"
#include "render/common/method.h"
#include "render/depth/camera_depths.h"
#include "render/depth/fusion.h"
#include "render/sampling/depth_sampling.h"

namespace raystage::render {

/// Returns the method "depth" (design, Reconstruction). It estimates the depth of every pixel of
/// every camera once per instant and stores it. It fuses a view's depths from those of its nearest
/// cameras. A pixel is the weighted mean of the cameras that see the point; outliers have less
/// weight. A = min(1, w / kFullAlphaWeight), w = the sum of the weights of the selected cameras
/// that see the point. Coverage is A less the weights of cameras that would be selected but have no
/// frame at this instant. z: planar depth of the point. A pixel at an edge of depth shows two
/// surfaces (surface_pairs.h, RenderedView::edges). Throws Error (bad input) if neither the
/// take nor the options give the depth range of the scene.
const Method& depth_method();

/// Cost of depth estimation; 0 if the depths were stored already.
struct DepthEstimationStatistics {
  std::size_t bytes = 0;            ///< peak working memory
  std::int64_t pixels_decoded = 0;  ///< of the cameras' frames, summed
};

namespace depth {

struct DepthViewOptions {
  DepthEstimationOptions estimation;
  int cameras = 16;
  double agreement = 10;  ///< colour difference of half weight, codes of 255
  Interpolation interpolation = Interpolation::kCubic;  ///< of source frames
  bool stores_depths = true;                            ///< store depths in the take's folder
  bool all_cameras = false;                             ///< estimate all depths, whatever is shown
  bool temporal = false;   ///< average depths with those of adjacent_frames
  bool soft_edges = true;  ///< pixels at edges of depth show two surfaces
};

/// The depths of the cameras of a light field frame.
struct NotedDepths {
  CameraDepths depths;
  std::vector<std::string> notes;  ///< for the user
};

/// The inputs of rendering a view, for render() and render_reference().
struct DepthViewPlan {
  DepthViewOptions settings;
  VirtualCamera pinhole;                  ///< the view, without its lens distortion
  InverseDepthRange range;                ///< of what it sees
  BlendingField field;                    ///< of the cameras that have a frame and depths
  std::optional<BlendingField> complete;  ///< as if no camera were absent; set only if one is
  std::shared_ptr<const CameraDepths> depths;
  InverseDepthMap view_depths;     ///< of the pinhole's pixels; all known
  std::vector<std::string> notes;  ///< see RenderedView::notes
  DepthEstimationStatistics work;  ///< cost of the plan; see RenderStatistics
};
/// Returns the plan, or nullopt if the view sees nothing of the scene.
std::optional<DepthViewPlan> plan(const ViewRequest& request);

// The steps of plan(), for hosts that make a plan together.

/// Returns the plan without the depths of the cameras and of the view.
std::optional<DepthViewPlan> plan_without_depths(const ViewRequest& request);
/// The inputs of fuse_hypotheses() for a view.
struct FusionInputs {
  std::vector<DepthHypotheses> hypotheses;  ///< map: empty if the plan has none of the camera
  std::vector<int> cameras;                 ///< rig index of each hypothesis, increasing
  FusionOptions settings;
};
FusionInputs fusion_inputs(const DepthViewPlan& plan, const ViewRequest& request);
/// Sets unknown depths to the farthest depth of the view.
void fill_unknown_depths(const DepthViewPlan& plan, InverseDepthMap& view_depths);
/// Returns a key of all inputs of an instant's depths except the take.
std::string depth_cache_key(const LightFieldFrame& instant, const DepthEstimationOptions& settings);
/// Returns notes for the user about the depths of an instant's cameras; reads no maps.
std::vector<std::string> depth_notes(const CameraDepths& depths, const LightFieldFrame& instant,
                                     const DepthEstimationOptions& settings);

/// Returns the depths of an instant's cameras with the default options and the depth range `scene`.
/// Caches them in `result_cache` and, if `stores_depths`, stores them in the take. Adds the cost to
/// `work`.
std::shared_ptr<const CameraDepths> depths_with_default_options(
    const LightFieldFrame& instant, ResultCache& result_cache, std::size_t working_bytes,
    bool stores_depths, const schemas::DepthRange& scene, DepthEstimationStatistics& work);

/// Returns the inverse depth, 1/m along the view's axis, by which a camera's depth may be nearer
/// than a point that counts as visible.
float visibility_tolerance(const DepthViewPlan& plan);

/// Returns VisibilityRun::border: above 0 where depths are those of regions, beyond which other
/// cameras are meant to show the points.
float visibility_border(const DepthViewPlan& plan);

/// Returns how far a camera sees a point by its own depths, 0 to 1, in double; see VisibilityRun.
/// The point has the inverse planar depth `inverse_depth` (1/m) in the view and lies along
/// `towards` from the camera's centre (world, vector to the point times `inverse_depth`).
double point_visibility(const DepthViewPlan& plan, int camera, const Eigen::Vector3d& towards,
                        double inverse_depth);

/// Returns the part of the visibility for which the camera's own depth is that of the point, in
/// double; see compute_surface_share().
double point_surface_share(const DepthViewPlan& plan, int camera, const Eigen::Vector3d& towards,
                           double inverse_depth);

/// Fills RenderedView::cameras and nearest_ray.
void measure_coverage(const ViewRequest& request, const DepthViewPlan& plan, RenderedView& image);

/// Returns the view by the kernels, or by the per-pixel reference in double.
RenderedView render(const ViewRequest& request);
RenderedView render_reference(const ViewRequest& request);

}  // namespace depth
}  // namespace raystage::render
