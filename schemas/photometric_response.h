// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <vector>

namespace raystage {

using Rgb = std::array<double, 3>;  ///< linear light, full scale 1

/// A lens' fall of light towards the corners, as Adobe's DNG states it (opcode
/// FixVignetteRadial): what is shown gains 1 + a[0] r^2 + a[1] r^4 + a[2] r^6.
struct Vignetting {
  double cx = 0, cy = 0;             ///< pixels from the picture's top-left corner; r = 0
  std::array<double, 3> a{0, 0, 0};  ///< r = 1: half the picture's diagonal
  bool operator==(const Vignetting&) const = default;
};

/// What each part of the picture gains (a flat field; DNG's opcode GainMap): nodes evenly spaced
/// from corner to corner of the picture, bilinear between them.
struct GainMap {
  int columns = 0, rows = 0;  ///< at least 2 each
  std::vector<Rgb> gain;      ///< columns * rows, by rows
  bool operator==(const GainMap&) const = default;
};

/// A pixel that shows light in the dark (fixed-pattern noise).
struct HotPixel {
  int x = 0, y = 0;
  Rgb light{};
  bool operator==(const HotPixel&) const = default;
};

using ColorMatrix = std::array<Rgb, 3>;  ///< by rows, for columns R, G, B
inline constexpr ColorMatrix kIdentityColorMatrix{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

/// How a camera's codes become the light that a reference camera would have shown (thesis eq. 4.1
/// and section 4.3), per channel R, G, B on linear light, full scale 1:
///
///     light = matrix * (gain at the pixel * (brightness + contrast * (shown - dark)))
///
/// where shown is the light of the code after `curve`, in the colour space of the take. See
/// rig/photometric.h.
struct PhotometricResponse {
  Rgb contrast{1, 1, 1};
  Rgb brightness{0, 0, 0};
  /// Per channel: what codes ought to be, full scale 1, at codes evenly spaced from 0 to full
  /// scale, rising, a straight line between them. Empty: as they are.
  std::array<std::vector<double>, 3> curve{};
  std::optional<Vignetting> vignetting{};
  std::optional<GainMap> gain_map{};
  ColorMatrix matrix = kIdentityColorMatrix;
  /// By rows, from left to right. One with more than kMaxHotPixelLevel in a channel has too little
  /// of its range left: it is shown as its neighbours are.
  std::vector<HotPixel> hot_pixels{};
  static constexpr double kMaxHotPixelLevel = 0.25;
  static constexpr std::size_t kMaxHotPixels = 20000;

  bool operator==(const PhotometricResponse&) const = default;
};

}  // namespace raystage
