// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

namespace raystage::render {

/// A pass over all cameras that computes a new map for each.
struct EstimationPass {
  /// By camera in the order of the pass: the other cameras whose image and current map it reads.
  std::vector<std::vector<std::size_t>> reads;
  bool images = false, maps = false;  ///< which of the two it reads

  /// Returns, by camera, the last camera of the pass that reads its current map.
  std::vector<std::size_t> last_readers() const;
};

/// Working memory of one camera, bytes: the minimum, and the amount beyond which it does not get
/// faster.
struct CameraMemory {
  std::size_t minimum = 0, sufficient = 0;
};

/// Division of the working memory of depth estimation. Cameras are processed in groups: the
/// matching images that a group reads are in memory, and new maps until the current ones are read.
struct EstimationMemory {
  std::size_t group = 1;      ///< cameras
  std::size_t in_flight = 1;  ///< cameras processed at once
  std::size_t each = 0;       ///< bytes per camera in flight, at least CameraMemory::minimum
  std::size_t held = 0;       ///< bytes of images and new maps, at most
};

/// Returns the plan with the largest group that leaves a camera CameraMemory::sufficient. `pixels`:
/// of each camera's map. Throws Error (bad input) if one camera at a time does not fit
/// `working_bytes`.
EstimationMemory plan_estimation_memory(const std::vector<EstimationPass>& passes,
                                        const std::vector<std::size_t>& pixels, CameraMemory camera,
                                        std::size_t working_bytes);

}  // namespace raystage::render
