// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "store/processing/mattes/screen_key.h"
#include "store/take.h"

namespace raystage {

/// What a camera would see of the set if nobody stood before it: linear light at each pixel.
class EmptySet {
 public:
  /// The same everywhere.
  explicit EmptySet(const LinearColour& colour) : light_(colour) {}

  /// A screen's light, smooth over the picture: a polynomial of second degree in each channel,
  /// fitted to those of the pixels (R, G, B each; rows without padding) that show the screen.
  /// Throws Error (bad input) where these are less than 2 %; `name`: of the frame.
  static EmptySet fitted(std::span<const float> rgb, int width, int height, const ScreenKey& key,
                         const std::string& name);
  /// As an empty take's camera saw it: the mean of its first frames, kMostEmptyFrames of them.
  static EmptySet recorded(const Take& clean_plate_take, int camera);
  static constexpr int kMostEmptyFrames = 8;

  LinearColour at(int x, int y) const;

 private:
  struct Polynomial {
    int width = 1, height = 1;
    std::array<std::array<float, 6>, 3> of_channel{};  ///< 1, x, y, x x, x y, y y; x, y in [-1, 1]
    LinearColour least{}, most{};                      ///< of the pixels it was fitted to
  };
  struct Picture {
    int width = 0;
    float per_code = 0;
    std::vector<std::uint16_t> codes;
  };
  explicit EmptySet(std::variant<LinearColour, Polynomial, Picture> light)
      : light_(std::move(light)) {}

  std::variant<LinearColour, Polynomial, Picture> light_;
};

/// Linear light of a camera's frame, R, G, B a pixel, calibrated.
std::vector<float> linear_frame(const Take& take, int camera, int frame);

}  // namespace raystage
