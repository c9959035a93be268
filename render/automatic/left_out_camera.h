// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/view/method.h"

namespace raystage {

/// PSNR, dB, of what `method` reconstructs in place of cameras that are left out for it, in the
/// mean over up to three in the middle of the array, at the middle instant of the take. Minus
/// infinity where nothing can be left out (too few cameras) or nothing is seen. Of `request` it
/// uses the take and its cameras, the focal plane and the means, not the view.
double error_at_left_out_cameras(const Method& method, const OptionValues& options,
                                 const ViewRequest& request);

}  // namespace raystage
