// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <variant>

#include "base/image.h"
#include "store/processing/mattes/keyers.h"
#include "store/take.h"

namespace raystage::store {

/// The clean plate of a camera: linear light of the set without the subject, at each pixel.
class CleanPlate {
 public:
  /// Makes a plate of one colour.
  explicit CleanPlate(const LinearColour& colour) : light_(colour) {}

  /// Returns the light of a screen: a polynomial of second degree per channel, fitted to the pixels
  /// that show the screen. `rgb`: linear light; `name`: the frame in errors. Throws Error (bad
  /// input) if less than 2 % of the pixels show the screen.
  static CleanPlate fitted(const Image<float, 3>& rgb, const ColorDifferenceKeyer& key,
                           const std::string& name);
  /// Returns the mean of the first kMaxCleanPlateFrames frames of a camera of an empty take.
  static CleanPlate recorded(const Take& clean_plate_take, int camera);
  static constexpr int kMaxCleanPlateFrames = 8;

  /// Returns the linear light at a pixel.
  LinearColour at(int x, int y) const;

 private:
  struct Polynomial {
    int width = 1, height = 1;
    std::array<std::array<float, 6>, 3> of_channel{};  ///< 1, x, y, xx, xy, yy; x, y in [-1, 1]
    LinearColour least{}, most{};                      ///< bounds of the result
  };
  struct Picture {
    float per_code = 0;
    Image<std::uint16_t, 3> codes;
  };
  explicit CleanPlate(std::variant<LinearColour, Polynomial, Picture> light)
      : light_(std::move(light)) {}

  std::variant<LinearColour, Polynomial, Picture> light_;
};

/// Returns the linear light of a frame after photometric correction, R, G, B per pixel.
Image<float, 3> linear_frame(const Take& take, int camera, int frame);

}  // namespace raystage::store
