// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace raystage {

/// What shows of a take's frames: a shot layer's "matte".
struct MatteSettings {
  using Box = std::array<std::array<double, 3>, 2>;  ///< least and most corner, world, metres
  enum class Kind {
    kBlueScreen,
    kGreenScreen,
    kDifference,  ///< from what the empty take shows
    kFiles        ///< TAKE/mattes, docs/formats/mattes.md
  } kind = Kind::kBlueScreen;
  /// Of a screen: its colour, scene-linear. None, and no empty take: found in the take itself.
  std::optional<std::array<double, 3>> screen_color = {};
  std::string clean_plate_take =
      {};  ///< the same array and no actor; relative to the shot's folder
  /// Of a screen: how much of its colour others may have: the larger of them (1), the smaller (0).
  double balance = 0.5;
  double despill = 1;  ///< of a screen: how much of its light is taken off what stands before it
  /// Alpha up to `black` is 0, from `white` on 1.
  double black = 0.05, white = 0.95;
  /// Of a difference: in codes of 255, transparent up to `low`, opaque from `high` on.
  double low = 10, high = 30;
  std::vector<Box> keep = {};     ///< what no ray through one of them sees is transparent, if any
  std::vector<Box> garbage = {};  ///< so is what rays through these see
};

/// As it stands in a shot, with everything not given.
std::string format_matte(const MatteSettings& matte);

}  // namespace raystage
