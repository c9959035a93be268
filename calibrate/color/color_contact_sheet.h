// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "schemas/rig_document.h"
#include "store/jpeg/rgb_image.h"
#include "store/take.h"

namespace raystage {

/// A contact sheet of what a take's cameras show in the middle of the take, sRGB codes: on the left
/// as it was recorded, on the right as `rig` corrects it; cameras where they stand in the array, in
/// a square where they have no such place. Throws Error (bad input) where the rig has not the
/// take's cameras, or one of them has no frames.
RgbImage make_color_contact_sheet(const Take& take, const RigDocument& rig);

}  // namespace raystage
