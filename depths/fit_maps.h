// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "schemas/imported_depths_document.h"
#include "store/take.h"

namespace raystage::depths {

/// Gives imported depth maps the numbers that their frames have since a repair. Returns the number
/// of maps of frames that the take no longer has: these are removed from the list.
std::size_t fit_maps_to_frames(schemas::ImportedDepthsDocument& document, const store::Take& take);

}  // namespace raystage::depths
