// SPDX-License-Identifier: Apache-2.0
// --lens-model and --half-angle-deg: the kind of lenses to be calibrated.
#include "cli/lens_model_option.h"

#include <map>

#include "schemas/projection_names.h"

namespace raystage::cli {

Option add_lens_model_options(CommandLine& command, LensModelOption& option, bool may_compare,
                              const std::string& more) {
  std::map<std::string, LensModelOption::Choice> choices;
  for (const schemas::Projection projection : schemas::projections()) {
    choices[std::string(schemas::name_of(projection))] = {projection, false};
  }
  if (may_compare) choices["auto"] = {std::nullopt, true};
  command
      .option(
          "--half-angle-deg", option.half_angle_deg,
          "Fisheyes: largest angle of a recorded ray to the axis, degrees, where the picture of "
          "the lens ends (default: that of the take's rig, otherwise unlimited)")
      .limits(1.0, 180.0);
  return command.choice("--lens-model", option.choice, choices,
                        "Projection of the lenses; fisheye (OpenCV's) and ftheta are alike" + more);
}

}  // namespace raystage::cli
