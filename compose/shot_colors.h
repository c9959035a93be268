// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>

#include "compose/color/color_config.h"
#include "schemas/shot_document.h"

namespace raystage {

/// The colour spaces of a shot. Light fields, plates and what mesh files say come as kSceneSpace;
/// layers are lit and put together in the working space; files are in a space of their own.
struct ShotColors {
  std::optional<ColorConfig> studio;                 ///< none: the built-in config will do
  std::optional<ColorTransform> working_from_scene;  ///< none: the same
  std::optional<ColorTransform> file_from_working;   ///< none: the same
  Eigen::Matrix3f working_from_scene_matrix = Eigen::Matrix3f::Identity();
  std::string interop_id{kSceneSpace};  ///< of the files
  std::string space = {}, config = {};  ///< of the files, for their headers; empty: kSceneSpace
};

/// `config_file`: in place of the shot's; empty: the shot's, else the built-in config, which is
/// loaded only where a space is another. `folder`: what the shot's is relative to. Throws Error
/// (bad input) where a space is unknown or the files' is not linear light.
ShotColors shot_colors(const ShotDocument& shot, const std::filesystem::path& shot_file,
                       const std::filesystem::path& folder,
                       const std::filesystem::path& config_file);

}  // namespace raystage
