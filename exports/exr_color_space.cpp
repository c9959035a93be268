// SPDX-License-Identifier: Apache-2.0
#include "exports/exr_color_space.h"

#include "base/error.h"

namespace raystage::exports {

ExrColorSpace exr_color_space(const std::string& space, const std::filesystem::path& config_file,
                              const std::string& rec709_name) {
  const compose::ColorConfig config =
      config_file.empty() ? compose::ColorConfig::built_in()
                          : compose::ColorConfig::from_file(config_file, rec709_name);
  const compose::ColorTransform transform = config.to_space(space);
  if (!transform.is_linear()) {
    throw Error::bad_input("the colour space \"" + space + "\" is not linear light",
                           config_file.empty() ? "built-in config" : config_file.string(),
                           "Choose a linear space for EXR files");
  }
  ExrColorSpace result;
  if (!transform.is_no_op()) result.from_scene = transform;
  result.interop_id = config.interop_id(space);
  result.space = space;
  result.config = config.description();
  return result;
}

}  // namespace raystage::exports
