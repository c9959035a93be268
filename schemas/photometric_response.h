// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <vector>

namespace raystage::schemas {

using Rgb = std::array<double, 3>;  ///< linear light, full scale 1

/// Correction of a lens's vignetting as in Adobe's DNG (opcode FixVignetteRadial): light is
/// multiplied by 1 + a[0] r^2 + a[1] r^4 + a[2] r^6.
struct Vignetting {
  double cx = 0, cy = 0;             ///< centre (r = 0), pixels from the picture's top-left corner
  std::array<double, 3> a{0, 0, 0};  ///< coefficients; r = 1 at half the picture's diagonal
  bool operator==(const Vignetting&) const = default;
};

/// Gains over the picture (a flat field; DNG's opcode GainMap): nodes evenly spaced from corner to
/// corner of the picture, with bilinear interpolation.
struct GainMap {
  int columns = 0, rows = 0;  ///< at least 2 each
  std::vector<Rgb> gain;      ///< columns * rows, row by row
  bool operator==(const GainMap&) const = default;
};

/// A pixel with a signal in the dark frame (fixed-pattern noise).
struct HotPixel {
  int x = 0, y = 0;
  Rgb light{};  ///< in the dark frame
  bool operator==(const HotPixel&) const = default;
};

using ColorMatrix = std::array<Rgb, 3>;  ///< row-major, applied to columns (R, G, B)
inline constexpr ColorMatrix kIdentityColorMatrix{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

/// The conversion of a camera's codes to the light that a reference camera would have recorded
/// (thesis eq. 4.1 and section 4.3), per channel R, G, B on linear light, full scale 1:
///
///     light = matrix * (gain at the pixel * (brightness + contrast * (shown - dark)))
///
/// `shown` is the light of the code after `curve`, in the colour space of the take. `dark` is that
/// of the pixel in the dark frame. See rig/photometric_model.h.
struct PhotometricResponse {
  Rgb contrast{1, 1, 1};
  Rgb brightness{0, 0, 0};
  /// Per channel: corrected codes, full scale 1, increasing, at codes evenly spaced from 0 to full
  /// scale, with linear interpolation. Empty: codes are correct.
  std::array<std::vector<double>, 3> curve{};
  std::optional<Vignetting> vignetting{};
  std::optional<GainMap> gain_map{};
  ColorMatrix matrix = kIdentityColorMatrix;
  /// Sorted by row, then column. A pixel above kMaxHotPixelLevel in a channel has too little range
  /// left: it is interpolated from its neighbours.
  std::vector<HotPixel> hot_pixels{};
  static constexpr double kMaxHotPixelLevel = 0.25;
  static constexpr std::size_t kMaxHotPixels = 20000;

  bool operator==(const PhotometricResponse&) const = default;
};

}  // namespace raystage::schemas
