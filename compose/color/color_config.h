// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace raystage {

/// The space that light fields and mesh files bring, and that layers are put together in unless a
/// shot says another: linear light, Rec.709 primaries. Named as ASWF's ColorInterop names it.
inline constexpr std::string_view kSceneSpace = "lin_rec709_scene";

/// From one colour space to another. Many threads may apply it.
class ColorTransform {
 public:
  /// Premultiplied R, G, B, A a pixel, in place. Colours are divided by their alpha before and
  /// multiplied after, unless the transform is a matrix, to which that makes no difference.
  void apply(std::span<float> rgba) const;
  /// R, G, B a pixel that are not premultiplied.
  void apply_rgb(std::span<float> rgb) const;
  /// Whether twice the light becomes twice the light, and colours add up as before.
  bool is_linear() const;
  bool is_no_op() const;

 private:
  friend class ColorConfig;
  struct State;
  explicit ColorTransform(std::shared_ptr<const State> state) : state_(std::move(state)) {}
  std::shared_ptr<const State> state_;
};

/// Colour spaces and displays, by OpenColorIO: the studio's config, or one that is built in. $OCIO
/// is never looked at.
class ColorConfig {
 public:
  /// Spaces lin_rec709_scene, lin_ap1_scene (ACEScg), lin_ap0_scene (ACES2065-1) and srgb_texture;
  /// displays sRGB, Rec.1886 and P3-D65, each with the views "Plain" and "ACES 1.0 SDR".
  static ColorConfig built_in();
  /// Throws Error (bad input) where the file cannot be read, is no config, or knows no space by any
  /// name that linear Rec.709 goes by; `rec709_name`: its name there, empty: found.
  static ColorConfig from_file(const std::filesystem::path& file, const std::string& rec709_name);

  /// For headers and fingerprints: its name, and a hash of what it says.
  const std::string& description() const;
  /// From kSceneSpace. Throws Error (bad input), naming the spaces there are, for an unknown one.
  ColorTransform to_space(const std::string& space) const;
  /// To kSceneSpace. Throws Error likewise.
  ColorTransform from_space(const std::string& space) const;
  /// Throws Error likewise.
  ColorTransform between(const std::string& from, const std::string& to) const;
  /// From a space to what a display shows through a view: codes of full scale 1. Empty names: the
  /// config's default. Throws Error (bad input), naming those there are.
  ColorTransform to_display(const std::string& space, const std::string& display,
                            const std::string& view) const;
  /// The space's name in ASWF's ColorInterop list where it has one: lin_rec709_scene,
  /// lin_ap1_scene, lin_ap0_scene; else "unknown".
  std::string interop_id(const std::string& space) const;
  /// The config's own name for a space of a file's colorInteropID; empty where it has none.
  std::string space_from_interop_id(std::string_view id) const;

 private:
  struct State;
  explicit ColorConfig(std::shared_ptr<const State> state) : state_(std::move(state)) {}
  std::shared_ptr<const State> state_;
};

}  // namespace raystage
