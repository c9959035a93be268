// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "rig/photometric.h"
#include "store/frames/frame_matte.h"
#include "store/take.h"

namespace raystage {

/// A whole frame, corrected by a response of its own: R, G, B, 65535 per pixel, by rows.
struct CorrectedPicture {
  PictureSize size;
  std::vector<std::uint16_t> rgba;
};

/// Throws Error (bad input) for a damaged frame.
CorrectedPicture corrected_picture(const Take& take, int camera, int frame,
                                   const PhotometricResponse& response, const CodeScale& scale);

}  // namespace raystage
