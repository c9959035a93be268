// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "schemas/shot_document.h"

namespace raystage::testing {

/// Returns a key of a camera that looks down -z. `position`: metres.
inline schemas::ShotDocument::CameraKey camera_key(double frame,
                                                   const std::array<double, 3>& position,
                                                   double horizontal_fov_deg) {
  return {.frame = frame,
          .position = position,
          .orientation = std::array<double, 4>{1, 0, 0, 0},
          .horizontal_fov_deg = horizontal_fov_deg};
}

}  // namespace raystage::testing
