// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "compose/color/color_config.h"

namespace raystage::exports {

/// The colour space of exported EXR frames; by default scene-linear Rec.709.
struct ExrColorSpace {
  std::optional<compose::ColorTransform> from_scene = {};  ///< none: identity
  std::string interop_id{compose::kSceneSpace};            ///< for headers
  std::string space = {}, config = {};  ///< for headers; empty: kSceneSpace without a config

  bool is_scene_space() const { return space.empty(); }
};

/// Returns a colour space of an OpenColorIO config, or of the built-in one if `config_file` is
/// empty. `rec709_name`: as ColorConfig::from_file(). Throws Error (bad input) for an unknown space
/// and one that is not linear light.
ExrColorSpace exr_color_space(const std::string& space, const std::filesystem::path& config_file,
                              const std::string& rec709_name);

}  // namespace raystage::exports
