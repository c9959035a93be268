// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "render/common/blending_field.h"
#include "render/common/light_field_frame.h"
#include "render/common/rank_communicator.h"
#include "render/depth/estimation_regions.h"
#include "render/depth/inverse_depth_map.h"
#include "schemas/geometry.h"

namespace raystage::render {

/// Settings of depth estimation. They suit all takes: lengths are in pixels of disparity between
/// neighbouring cameras, differences in 8-bit codes.
struct DepthEstimationOptions {
  schemas::DepthRange scene;  ///< metres in front of the array; far may be infinite
  double plane_px = 0.5;      ///< spacing of the initial sweep planes; kMaxPlanes at most
  int neighbours = 8;         ///< cameras that each camera is matched with, 1 to kMaxNeighbours
  int support_views = 12;     ///< cameras that refine a depth
  double refine_px = 0.2;     ///< step between the kRefineOffsets depths
  double tolerance_px = 1;    ///< largest difference of two cameras' depths of a point
  EstimationRegions regions;  ///< pixels whose depths are estimated
  bool is_valid(std::string* reason) const;
};

/// Constants of the passes of estimate_camera_depths().
namespace depth_estimation {
inline constexpr int kMaxPlanes = 256;
/// SemiGlobalOptions::p1 and p2.
inline constexpr int kSmallJumpPenalty = 27,
                     kLargeJumpPenalty = 160;  ///< SemiGlobalOptions::p1 and p2
inline constexpr double kGuideScale = 7;       ///< SemiGlobalOptions::guide_scale
/// Weight of a camera's own depths; the warped depths of its neighbours have weight 1.
inline constexpr float kOwnHypothesisWeight = 1.5F;
inline constexpr float kMinSupport = 0.25F;  ///< FusionOptions::min_support
/// Widths of the edge-aware filter: in pixels, in codes of luma, and in pixels of disparity
/// between neighbouring cameras. An edge weight falls by 1/e for each width of luma or disparity.
inline constexpr double kFilterSigmaSpatial = 4, kFilterSigmaLuma = 12, kFilterSigmaDisparity = 0.5;
}  // namespace depth_estimation

/// The planes of a camera's initial plane sweep, evenly spaced in inverse depth. `count` is 0 if
/// the camera sees nothing of the scene.
struct InitialSweepPlanes {
  int count = 0;
  double farthest = 0, step = 0;  ///< inverse depths, 1/m; one plane is at `farthest`
  double needed = 0;  ///< planes that plane_px requires, before the limit; a whole number

  double inverse_depth(double plane) const { return farthest + plane * step; }
};

/// Inverse depth maps of all cameras that have a frame in a light field frame.
struct CameraDepths {
  /// By camera of the rig; see undistorted(). Those of DepthEstimationOptions::regions.
  std::vector<VirtualCamera> pinholes;
  std::vector<int> stations;  ///< by camera: rig::camera_stations()
  /// Empty where there is no frame, or no region.
  std::vector<InverseDepthMap> maps;
  /// The inverse depth, 1/m, that moves a point by one pixel between neighbouring stations (median
  /// over the rig). It is 0 if no two cameras see the same from different positions.
  double inverse_depth_per_pixel = 0;
  std::vector<InverseDepthMap> block_nearest;  ///< of the maps, by compute_block_nearest()
  /// Cost of the estimation: memory in addition to the maps, and pixels decoded. Both are 0 if the
  /// maps were read from a file.
  std::size_t working_bytes = 0;
  std::int64_t pixels_decoded = 0;

  void compute_block_nearest();
  std::size_t bytes() const;
};

/// Returns the depths of all cameras, estimated in three passes over the cameras:
///   1. matching with the neighbours (mean of the smaller half of the differences, semi-global
///      matching);
///   2. fusion: each pixel takes the hypothesis that most neighbours support, its own included, and
///      those that took the depth of a surface in front are corrected (foreground_fattening.h);
///   3. refinement by fractions of a pixel to the depth at which the support views agree best,
///      smoothed by a filter that stops at edges of luma and of depth.
/// The result depends on neither the number of threads nor `working_bytes`, which limits the memory
/// in addition to the result. It includes a matching image per camera (6 bytes a pixel, computed
/// again if not all fit) and a second map until the neighbours have read the first. The rest is the
/// memory of the cameras in flight. See EstimationMemory. Throws Error (bad input) if a frame
/// cannot be read or if one camera at a time does not fit.
CameraDepths estimate_camera_depths(const LightFieldFrame& instant,
                                    const DepthEstimationOptions& options,
                                    std::size_t working_bytes);

/// Returns the depths of the cameras that this host holds (LightFieldFrame::is_local); other maps
/// are empty. All hosts of `group` must call it: they exchange maps after the first and the second
/// pass. The depths equal those of estimate_camera_depths().
CameraDepths estimate_local_depths(const LightFieldFrame& instant,
                                   const DepthEstimationOptions& options, std::size_t working_bytes,
                                   const RankCommunicator& group);

/// Estimates the same pixel by pixel in double, single-threaded: the reference of
/// estimate_camera_depths().
CameraDepths estimate_camera_depths_reference(const LightFieldFrame& instant,
                                              const DepthEstimationOptions& options);

/// Returns CameraDepths without maps (pinholes and `inverse_depth_per_pixel`), for stored maps.
CameraDepths camera_depths_without_maps(const LightFieldFrame& instant,
                                        const DepthEstimationOptions& options);

/// Returns the planes of the camera's initial plane sweep; see InitialSweepPlanes.
InitialSweepPlanes initial_sweep_planes(const CameraDepths& depths, const LightFieldFrame& instant,
                                        int camera, const DepthEstimationOptions& options);

/// Returns at most `count` other cameras that have a frame, see a part of the scene that `camera`
/// sees, and are at another position; nearest first.
std::vector<int> depth_neighbours(const CameraDepths& depths, const LightFieldFrame& instant,
                                  int camera, const InverseDepthRange& range, int count);

}  // namespace raystage::render
