// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "render/common/blending_field.h"
#include "render/common/light_field_frame.h"
#include "render/common/rank_communicator.h"
#include "render/depth/inverse_depth_map.h"
#include "schemas/geometry.h"

namespace raystage {

/// How depths are found. The same for all takes: lengths are in pixels of disparity between
/// neighbouring cameras, differences in 8-bit codes.
struct DepthEstimationSettings {
  DepthRange scene;         ///< metres in front of the array; far may be infinite
  double plane_px = 0.5;    ///< from plane to plane of the first guess; planes: 256 at most
  int neighbours = 8;       ///< cameras that a guess is matched with, 1 to kMaxNeighbours
  int support_views = 12;   ///< cameras that a depth is refined with
  double refine_px = 0.2;   ///< from one of the kRefineOffsets depths to the next
  double tolerance_px = 1;  ///< by how much two cameras' depths of a point may differ
};

/// What the passes of estimate_camera_depths() weigh with.
namespace depth_estimation {
inline constexpr int kMostPlanes = 256;
inline constexpr int kSmallJumpPenalty = 27,
                     kLargeJumpPenalty = 160;  ///< SemiGlobalSettings::p1 and p2
inline constexpr double kGuideScale = 7;       ///< SemiGlobalSettings::guide_scale
/// A camera knows its own pixels a little better than others' warped ones.
inline constexpr float kOwnHypothesisWeight = 1.5F;
inline constexpr float kMinSupport = 0.25F;  ///< FusionSettings::min_support
/// Pixels are linked over this distance where nothing parts them; and by 1/e less for each so many
/// codes of luma, and pixels of disparity between neighbouring cameras, from one to the next.
inline constexpr double kFilterSigmaSpatial = 4, kFilterSigmaLuma = 12, kFilterSigmaDisparity = 0.5;
}  // namespace depth_estimation

/// Planes of the first guess, and what is between them. None where the camera sees nothing of the
/// scene.
struct InitialSweepPlanes {
  int count = 0;
  double farthest = 0, step = 0;  ///< inverse depths, 1/m; one plane is at `farthest`
  double needed = 0;  ///< how many DepthEstimationSettings::plane_px takes, a whole number

  double inverse_depth(double plane) const { return farthest + plane * step; }
};

/// A depth for every pixel of every camera that has a frame at an instant.
struct CameraDepths {
  std::vector<VirtualCamera> pinholes;  ///< by camera of the rig; see undistorted()
  std::vector<InverseDepthMap> maps;    ///< empty where there is no frame
  /// The inverse depth, 1/m, that moves a point by one pixel between neighbouring cameras (median
  /// over the rig); 0 where no two cameras see the same from different places.
  double pixel = 0;
  std::vector<InverseDepthMap>
      nearest;  ///< block_nearest_depths() of the maps; see compute_block_nearest()
  /// What finding them took: memory beside them, and pixels of the frames decoded for it; 0 where
  /// they were read.
  std::size_t working_bytes = 0;
  std::int64_t pixels_decoded = 0;

  void compute_block_nearest();
  std::size_t bytes() const;
};

/// Finds them in three passes over all cameras: each is matched with its neighbours (smaller half
/// of the differences, semi-global matching); then each takes the depth that most of its neighbours
/// report for the pixel, its own among them; then depths are shifted, in fractions of a pixel, to
/// where all cameras that see the point agree best, with edges of the picture and of the depth
/// holding apart what does not belong together.
///
/// The result depends on neither the number of threads nor `working_bytes`, which bounds the memory
/// taken beside the result: for each camera a matching image (4 bytes a pixel), made again where
/// not all fit, and a second map until its neighbours have read the first; and what cameras in
/// flight need. See EstimationMemory. Throws Error (bad input) for frames that cannot be read, and
/// where one camera at a time does not fit.
CameraDepths estimate_camera_depths(const LightFieldFrame& instant,
                                    const DepthEstimationSettings& settings,
                                    std::size_t working_bytes);

/// The same on several hosts, which must all call it: each finds the depths of the cameras that it
/// holds (LightFieldFrame::is_local), with the frames and the maps of their neighbours; maps of
/// other cameras are empty. Hosts exchange maps after the first and after the second pass. The
/// depths are those of estimate_camera_depths().
CameraDepths estimate_local_depths(const LightFieldFrame& instant,
                                   const DepthEstimationSettings& settings,
                                   std::size_t working_bytes, const RankCommunicator& group);

/// The slow, obvious way: pixel by pixel in double, on one thread, everything at once in memory.
CameraDepths estimate_camera_depths_reference(const LightFieldFrame& instant,
                                              const DepthEstimationSettings& settings);

/// The pinholes and the pixel of CameraDepths, without maps: what stored maps are completed with.
CameraDepths camera_depths_without_maps(const LightFieldFrame& instant,
                                        const DepthEstimationSettings& settings);

InitialSweepPlanes initial_sweep_planes(const CameraDepths& depths, const LightFieldFrame& instant,
                                        int camera, const DepthEstimationSettings& settings);

/// Other cameras of the rig that have a frame and see a part of what `camera` does in the scene,
/// from another place: nearest first, `count` at most.
std::vector<int> depth_neighbours(const CameraDepths& depths, const LightFieldFrame& instant,
                                  int camera, const InverseDepthRange& range, int count);

}  // namespace raystage
