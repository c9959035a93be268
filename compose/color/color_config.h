// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compose/color/scene_space.h"

namespace raystage::compose {

/// Converts from one colour space to another. Thread-safe. Throws Error as sandbox::DecoderProcess
/// does if the config is a given one.
class ColorTransform {
 public:
  /// Converts pixels of premultiplied R, G, B, A in place. Colours are divided by alpha before and
  /// multiplied after, unless the transform is linear, where that makes no difference.
  void apply(std::span<float> rgba) const;
  /// Converts pixels of R, G, B (not premultiplied) in place.
  void apply_rgb(std::span<float> rgb) const;
  /// Returns whether the transform is linear: a matrix without offset.
  bool is_linear() const;
  bool is_no_op() const;

  struct State;
  /// For ColorConfig.
  explicit ColorTransform(std::shared_ptr<const State> state) : state_(std::move(state)) {}

 private:
  std::shared_ptr<const State> state_;
};

/// Colour spaces and displays of an OpenColorIO config: given or built-in. $OCIO is ignored. A
/// given config is read, and its transforms that are no matrices are applied, by confined
/// processes. They may read regular files below the config's folder that are not behind links.
/// Thread-safe.
class ColorConfig {
 public:
  /// Returns the built-in config. Spaces: lin_rec709_scene, lin_ap1_scene (ACEScg), lin_ap0_scene
  /// (ACES2065-1) and srgb_texture. Displays: sRGB, Rec.1886 and P3-D65, each with the views
  /// "Plain" and "ACES 1.0 SDR".
  static ColorConfig built_in();
  /// Reads a config. `rec709_name`: name of linear Rec.709 in it; empty: its usual names are tried.
  /// Throws Error (bad input) if the file is no readable config or has no such space.
  static ColorConfig from_file(const std::filesystem::path& file, const std::string& rec709_name);

  /// Returns the name and a hash of the config, for headers and fingerprints.
  const std::string& description() const;
  /// Returns the transform from kSceneSpace. Throws Error (bad input), which lists the known
  /// spaces, for an unknown one.
  ColorTransform to_space(const std::string& space) const;
  /// Returns the transform to kSceneSpace. Throws Error likewise.
  ColorTransform from_space(const std::string& space) const;
  /// Returns the transform between two spaces. Throws Error likewise.
  ColorTransform between(const std::string& from, const std::string& to) const;
  /// Returns the transform from a space to the codes (full scale 1) of a display with a view. Empty
  /// names: the config's defaults. Throws Error (bad input), which lists the displays and views.
  ColorTransform to_display(const std::string& space, const std::string& display,
                            const std::string& view) const;
  /// Returns the space's id in ASWF's ColorInterop list (lin_rec709_scene, lin_ap1_scene,
  /// lin_ap0_scene), or "unknown".
  std::string interop_id(const std::string& space) const;
  /// Returns the config's name of the space with a file's colorInteropID; empty if it has none.
  std::string space_from_interop_id(std::string_view id) const;

 private:
  struct State;
  explicit ColorConfig(std::shared_ptr<const State> state) : state_(std::move(state)) {}
  std::shared_ptr<const State> state_;
};

}  // namespace raystage::compose
