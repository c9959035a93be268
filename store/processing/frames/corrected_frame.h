// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "base/image.h"
#include "rig/photometric_model.h"
#include "store/processing/frames/frame_matte.h"
#include "store/processing/frames/photometric_correction.h"
#include "store/take.h"

namespace raystage::store {

/// The range of codes that count as not clipped; JPEG changes clipped codes by a few steps.
inline constexpr std::uint8_t kMinUnclippedCode = 2, kMaxUnclippedCode = 250;

/// Returns the parts of a response that do not depend on contrast: curve and hot pixels.
schemas::PhotometricResponse curve_and_hot_pixels_only(
    const schemas::PhotometricResponse& response);

/// Returns the levels, R, G, B, of a code at a pixel that is not a hot pixel.
std::array<std::uint16_t, 3> levels_from_code(const Take& take,
                                              const schemas::PhotometricResponse& response,
                                              const CodeScale& scale, std::uint8_t code);

/// A whole frame after photometric correction: R, G, B, 65535 per pixel.
using CorrectedFrame = Image<std::uint16_t, 4>;

/// Returns a frame, corrected by `response`. `expected`: the image size of `response`. `levels`:
/// the table of scale.space; null: computed here. Throws Error (bad input) if the frame is damaged
/// or has another size.
CorrectedFrame decode_corrected_frame(const Take& take, int camera, int frame,
                                      rig::PictureSize expected,
                                      const schemas::PhotometricResponse& response,
                                      const CodeScale& scale, const LevelTable& levels = nullptr);

}  // namespace raystage::store
