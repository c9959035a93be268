// SPDX-License-Identifier: Apache-2.0
#include "compose/shot_color_spaces.h"

#include <array>

#include "base/error.h"

namespace raystage::compose {
namespace {

Eigen::Matrix3f matrix_of(const ColorTransform& transform) {
  Eigen::Matrix3f matrix;
  for (Eigen::Index c = 0; c < 3; ++c) {
    std::array<float, 3> unit{};
    unit[c] = 1;
    transform.apply_rgb(unit);
    matrix.col(c) << unit[0], unit[1], unit[2];
  }
  return matrix;
}

}  // namespace

ShotColorSpaces make_shot_color_spaces(const schemas::ShotDocument& shot,
                                       const std::filesystem::path& shot_file,
                                       const std::filesystem::path& folder,
                                       const std::filesystem::path& config_file) {
  const schemas::ShotDocument::Color& color = shot.output.color;
  const bool has_config = !config_file.empty() || !color.config.empty();
  ShotColorSpaces result;
  const bool works_in_scene = color.working_space == kSceneSpace;
  if (!has_config && color.color_space == kSceneSpace && works_in_scene) return result;
  const ColorConfig config =
      has_config
          ? ColorConfig::from_file(
                config_file.empty() ? (folder / color.config).lexically_normal() : config_file,
                color.rec709_space)
          : ColorConfig::built_in();
  if (has_config) result.studio = config;
  if (!works_in_scene) {
    result.working_from_scene = config.to_space(color.working_space);
    result.working_from_scene_matrix = matrix_of(*result.working_from_scene);
  }
  const ColorTransform transform = config.between(color.working_space, color.color_space);
  if (!transform.is_linear()) {
    throw Error::bad_input("the colour space \"" + color.color_space + "\" is not linear light",
                           shot_file.string() + "#/output/color/space",
                           "Choose a linear space for EXR files");
  }
  if (!transform.is_no_op()) result.file_from_working = transform;
  result.interop_id = config.interop_id(color.color_space);
  result.space = color.color_space;
  result.config = config.description();
  return result;
}

}  // namespace raystage::compose
