// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>

#include "render/common/method.h"

namespace raystage {

/// How near a method comes to the pictures of cameras that are left out for it.
struct LeaveOneOutQuality {
  int cameras = 0;  ///< that were left out, one at a time; 0: none can be, and nothing is known
  /// PSNR, dB, over these cameras: mean and standard deviation. Of that part of their pictures that
  /// fares worst: of each corner and the middle, two thirds wide and high, as much as a view shows
  /// that asks for half again the cameras' resolution, which may be filled by what is difficult.
  /// Minus infinity where nothing is covered.
  double mean_db = -std::numeric_limits<double>::infinity(), stddev_db = 0;
  double covered = 0;  ///< share of the pictures' pixels that count (coverage_mask()), 0 to 1

  /// What a view may count on: less than the mean by the spread.
  double expected_db() const { return mean_db - stddev_db; }
};

/// Leaves out up to nine cameras, one at a time, and compares what `method` shows in their place
/// with what they saw. They are spread over the array as far as cameras stand between others, from
/// the centre to the rim but for its corners, and over the take's instants (LightFieldSequence): a
/// shot may show any. None of fewer than four. Of `request` it uses take and included_cameras of
/// the instant, the focal plane and the means, not the view.
LeaveOneOutQuality measure_leave_one_out_quality(const Method& method, const OptionValues& options,
                                                 const ViewRequest& request);

}  // namespace raystage
