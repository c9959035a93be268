// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/transfer_function.h"
#include "schemas/take_document.h"

namespace raystage::store {

/// Returns the linear light (full scale 1) of an 8-bit code, 0 to 255 or between codes, in a take's
/// frames, without photometric correction.
inline double linear_from_frame_code(const schemas::TakeDocument& take, double code) {
  const double value = code / 255.0;
  return take.color_space == "lin_rec709_scene" ? value : linear_from_srgb(value);
}

}  // namespace raystage::store
