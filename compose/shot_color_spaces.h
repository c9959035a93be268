// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>

#include "compose/color/color_config.h"
#include "schemas/shot_document.h"

namespace raystage::compose {

/// Colour spaces of a shot. Light fields, plates and colours of mesh files are in kSceneSpace;
/// layers are lit and merged in the working space; files are in the output space.
struct ShotColorSpaces {
  std::optional<ColorConfig> studio;                 ///< none: the built-in config suffices
  std::optional<ColorTransform> working_from_scene;  ///< none: identity
  std::optional<ColorTransform> file_from_working;   ///< none: identity
  Eigen::Matrix3f working_from_scene_matrix = Eigen::Matrix3f::Identity();
  std::string interop_id{kSceneSpace};  ///< of the files
  std::string space = {}, config = {};  ///< of the files, for their headers; empty: kSceneSpace
};

/// Returns the colour spaces of a shot. `config_file`: replaces the OpenColorIO config of the shot
/// unless empty; without either the built-in config is used, and loaded only if needed. `folder`:
/// what the path in the shot is relative to. Throws Error (bad input) for an unknown space, or an
/// output space that is not linear light.
ShotColorSpaces make_shot_color_spaces(const schemas::ShotDocument& shot,
                                       const std::filesystem::path& shot_file,
                                       const std::filesystem::path& folder,
                                       const std::filesystem::path& config_file);

}  // namespace raystage::compose
