// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

namespace raystage {

/// One pass over all cameras in turn, each of which gets a new map.
struct EstimationPass {
  /// By camera in the order of the pass: those whose image and present map it looks at, beside its
  /// own.
  std::vector<std::vector<std::size_t>> reads;
  bool images = false, maps = false;  ///< which of the two it looks at

  /// By camera: after which one its new map may take the place of the present one.
  std::vector<std::size_t> last_readers() const;
};

/// What one camera takes while it is worked on, bytes: no less than `least`; with `plenty` it is no
/// faster if it gets more.
struct CameraMemory {
  std::size_t least = 0, plenty = 0;
};

/// How a solve keeps within its memory. Cameras are done group by group: matching images are held
/// of those that a group looks at, and new maps until nobody looks at the present ones any more.
struct EstimationMemory {
  std::size_t group = 1;      ///< cameras
  std::size_t in_flight = 1;  ///< cameras worked on at once
  std::size_t each = 0;       ///< bytes for each of these, at least CameraMemory::least
  std::size_t held = 0;       ///< bytes of images and new maps, at most
};

/// The largest group that leaves plenty for a camera. `pixels`: of each camera's map. Throws Error
/// (bad input) where one camera at a time does not fit `working_bytes`.
EstimationMemory plan_estimation_memory(const std::vector<EstimationPass>& passes,
                                        const std::vector<std::size_t>& pixels, CameraMemory camera,
                                        std::size_t working_bytes);

}  // namespace raystage
