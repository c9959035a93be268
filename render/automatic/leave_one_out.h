// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>

#include "render/common/method.h"

namespace raystage::render {

/// The quality of a method at cameras that are left out of the reconstruction.
struct LeaveOneOutQuality {
  int cameras = 0;  ///< number of cameras left out, one at a time; 0: none can be, quality unknown
  /// PSNR in dB over these cameras: mean and standard deviation. It is measured on the worst of
  /// five parts of each image: the corners and the centre, each two thirds wide and high. A view
  /// with one and a half times the cameras' resolution shows such a part, which difficult content
  /// may fill. Minus infinity where nothing is covered.
  double mean_db = -std::numeric_limits<double>::infinity(), stddev_db = 0;
  double covered = 0;  ///< fraction of covered pixels (coverage_mask()), 0 to 1

  /// Returns the PSNR that a view can be expected to reach: the mean minus the standard deviation.
  double expected_db() const { return mean_db - stddev_db; }
};

/// Leaves out up to nine cameras, one at a time, and compares what `method` renders at their poses
/// with their frames. The cameras have others around them and are spread over the array, from the
/// centre to the rim without its corners. They are also spread over the take's frames
/// (LightFieldSequence), because a shot may show any. No camera is left out if fewer than four have
/// frames. `request` gives the take and included cameras, the focal plane and the memory limits;
/// its view is not used.
LeaveOneOutQuality measure_leave_one_out_quality(const Method& method,
                                                 const schemas::OptionValues& options,
                                                 const ViewRequest& request);

}  // namespace raystage::render
