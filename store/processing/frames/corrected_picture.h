// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "rig/photometric_model.h"
#include "store/processing/frames/frame_matte.h"
#include "store/processing/frames/photometric_correction.h"
#include "store/take.h"

namespace raystage {

/// Codes beyond which a pixel says too little of its light, as JPEG leaves what is cut off.
inline constexpr std::uint8_t kDarkestCode = 2, kBrightestCode = 250;

/// What of a response belongs to a camera's codes, whatever its contrast: curve and dark pixels.
PhotometricResponse as_shown(const PhotometricResponse& response);

/// What a code becomes, R, G, B, where the camera has no dark pixel.
std::array<std::uint16_t, 3> level_of_code(const Take& take, const PhotometricResponse& response,
                                           const CodeScale& scale, std::uint8_t code);

/// A whole frame, corrected by a response of its own: R, G, B, 65535 per pixel, by rows.
struct CorrectedPicture {
  PictureSize size;
  std::vector<std::uint16_t> rgba;
};

/// `expected`: the size that `response` is for. `levels`: of scale.space; null: made for it. Throws
/// Error (bad input) for a damaged frame or one of another size.
CorrectedPicture corrected_picture(const Take& take, int camera, int frame, PictureSize expected,
                                   const PhotometricResponse& response, const CodeScale& scale,
                                   const LevelTable& levels = nullptr);

}  // namespace raystage
