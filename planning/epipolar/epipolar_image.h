// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/image.h"
#include "render/common/view.h"

namespace raystage::planning {

enum class EpipolarAxis {
  kRow,    ///< cameras next to each other: lines of pixels
  kColumn  ///< cameras above each other: columns of pixels
};

/// An epipolar-plane image (Bolles, Baker and Marimont 1987; thesis 5.1.2): the same line of pixels
/// of all cameras of a row (or a column), one below the other. A point of the scene is a line in
/// it: vertical at infinity, the more inclined the nearer.
struct EpipolarImage {
  EpipolarAxis axis = EpipolarAxis::kRow;
  int position = 0;          ///< of the line in the middle camera, pixels from the top or left
  Image<std::uint8_t> luma;  ///< 8-bit codes, one row for each camera; 0: not seen
  std::vector<std::string> cameras;  ///< ids, from left to right or from below to above
  /// By how many pixels a point at 1 m is shifted from its place at infinity, by camera. Points at
  /// inverse depth q are shifted q times as far.
  std::vector<double> shift_at_one_metre;
};

/// Returns the image of the line of pixels with the most structure. `pinholes`: by camera, without
/// distortion; `luma`: their pictures, row-major, 0 is unknown; `line`: the cameras from left to
/// right or from below to above; `middle`: one of them.
EpipolarImage make_epipolar_image(std::span<const render::VirtualCamera> pinholes,
                                  std::span<const std::vector<std::uint8_t>> luma,
                                  std::span<const int> line, int middle, EpipolarAxis axis);

}  // namespace raystage::planning
