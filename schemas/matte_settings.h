// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace raystage::schemas {

/// Settings that separate the subject of a take from its background: "matte" of a shot's layer.
struct MatteSettings {
  using Box = std::array<std::array<double, 3>, 2>;  ///< minimum and maximum corner, world, metres
  enum class Kind {
    kBlueScreen,
    kGreenScreen,
    kDifference,  ///< difference from the clean plate take
    kFiles        ///< TAKE/mattes, docs/formats/mattes.md
  } kind = Kind::kBlueScreen;
  /// Screen keys: colour of the screen, scene-linear. nullopt: determined from the clean plate take
  /// or, without one, from the take itself.
  std::optional<std::array<double, 3>> screen_color = {};
  /// Take of the same array without the subject, relative to the shot's folder; may be empty.
  std::string clean_plate_take = {};
  /// Screen keys: limit of the screen's channel in the subject: the larger (1) or the smaller (0)
  /// of the other two channels.
  double balance = 0.5;
  double despill = 1;  ///< screen keys: share of the spill that is removed from the subject
  /// Alpha at or below `black` becomes 0, at or above `white` 1.
  double black = 0.05, white = 0.95;
  /// Difference key, in codes of 255: transparent up to `low`, opaque from `high`.
  double low = 10, high = 30;
  /// Pixels whose ray meets no box of `keep` (if it has any) or one of `garbage` are transparent.
  std::vector<Box> keep = {}, garbage = {};
};

/// Returns the JSON text of a shot's "matte", with the defaults of settings that are not given.
std::string format_matte(const MatteSettings& matte);

}  // namespace raystage::schemas
