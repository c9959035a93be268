// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "schemas/rig_document.h"
#include "store/jpeg/rgb_image.h"
#include "store/take.h"

namespace raystage::calibrate {

/// Returns a contact sheet of the frames in the middle of a take, sRGB codes: as recorded on the
/// left, corrected by `rig` on the right. Cameras are placed by their rows and columns in the
/// array, or in a square without these. Throws Error (bad input) if the cameras of rig and take
/// differ, or one has no frames.
store::RgbImage make_color_contact_sheet(const store::Take& take, const schemas::RigDocument& rig);

}  // namespace raystage::calibrate
