// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "render/depth/pinhole.h"
#include "render/sweep/camera_field.h"
#include "render/view/host_group.h"
#include "render/view/instant.h"
#include "schemas/geometry.h"

namespace raystage {

/// How depths are found. The same for all takes: lengths are in pixels of disparity between
/// neighbouring cameras, differences in 8-bit codes.
struct DepthSettings {
  DepthRange scene;         ///< metres in front of the array; far may be infinite
  double plane_px = 0.5;    ///< from plane to plane of the first guess; planes: 256 at most
  int neighbours = 8;       ///< cameras that a guess is matched with, 1 to kMostPartners
  int witnesses = 12;       ///< cameras that a depth is refined with
  double refine_px = 0.2;   ///< from one of the kOffsets depths to the next
  double tolerance_px = 1;  ///< by how much two cameras' depths of a point may differ
};

/// What the passes of solve_camera_depths() weigh with.
namespace depth_solve {
inline constexpr int kMostPlanes = 256;
inline constexpr int kOnePlane = 27, kJump = 160;  ///< SemiGlobalSettings::p1 and p2
inline constexpr double kGuideCodes = 7;           ///< SemiGlobalSettings::guide_scale
/// A camera knows its own pixels a little better than others' warped ones.
inline constexpr float kOwnReport = 1.5F;
inline constexpr float kLeastAgreeing = 0.25F;  ///< FusionSettings::least_share
/// Pixels are linked over this distance where nothing parts them; and by 1/e less for each so many
/// codes of luma, and pixels of disparity between neighbouring cameras, from one to the next.
inline constexpr double kLinkReach = 4, kLinkCodes = 12, kLinkDisparity = 0.5;
}  // namespace depth_solve

/// Planes of the first guess, and what is between them. None where the camera sees nothing of the
/// scene.
struct GuessPlanes {
  int count = 0;
  double farthest = 0, step = 0;  ///< inverse depths, 1/m; one plane is at `farthest`
  double needed = 0;              ///< how many DepthSettings::plane_px takes, a whole number

  double inverse_depth(double plane) const { return farthest + plane * step; }
};

/// A depth for every pixel of every camera that has a frame at an instant.
struct CameraDepths {
  std::vector<VirtualCamera> pinholes;  ///< by camera of the rig; see undistorted()
  std::vector<InverseDepthMap> maps;    ///< empty where there is no frame
  /// The inverse depth, 1/m, that moves a point by one pixel between neighbouring cameras (median
  /// over the rig); 0 where no two cameras see the same from different places.
  double pixel = 0;
  std::vector<InverseDepthMap> nearest;  ///< nearest_of_blocks() of the maps; see find_nearest()
  /// What finding them took: memory beside them, and pixels of the frames decoded for it; 0 where
  /// they were read.
  std::size_t working_bytes = 0;
  std::int64_t pixels_decoded = 0;

  void find_nearest();
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
/// flight need. See SolveMemory. Throws Error (bad input) for frames that cannot be read, and where
/// one camera at a time does not fit.
CameraDepths solve_camera_depths(const Instant& instant, const DepthSettings& settings,
                                 std::size_t working_bytes);

/// The same on several hosts, which must all call it: each finds the depths of the cameras that it
/// holds (Instant::is_held), with the frames and the maps of their neighbours; maps of other
/// cameras are empty. Hosts exchange maps after the first and after the second pass. The depths are
/// those of solve_camera_depths().
CameraDepths solve_held_depths(const Instant& instant, const DepthSettings& settings,
                               std::size_t working_bytes, const HostGroup& group);

/// The slow, obvious way: pixel by pixel in double, on one thread, everything at once in memory.
CameraDepths solve_camera_depths_reference(const Instant& instant, const DepthSettings& settings);

/// The pinholes and the pixel of CameraDepths, without maps: what stored maps are completed with.
CameraDepths depth_cameras(const Instant& instant, const DepthSettings& settings);

GuessPlanes guess_planes(const CameraDepths& depths, const Instant& instant, int camera,
                         const DepthSettings& settings);

/// Other cameras of the rig that have a frame and see a part of what `camera` does in the scene,
/// from another place: nearest first, `count` at most.
std::vector<int> depth_neighbours(const CameraDepths& depths, const Instant& instant, int camera,
                                  const InverseDepthRange& range, int count);

}  // namespace raystage
