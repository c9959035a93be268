// SPDX-License-Identifier: Apache-2.0
// --lens-model: the projection of lenses to be calibrated.
#include "cli/lens_model_option.h"

#include <map>

namespace raystage::cli {

Option add_lens_model_option(CommandLine& command, LensModelOption& option, bool may_compare,
                             const std::string& more) {
  using schemas::Projection;
  std::map<std::string, LensModelOption> choices{
      {"pinhole", {Projection::kPinhole, false}},
      {"fisheye", {Projection::kFisheye, false}},
      {"ftheta", {Projection::kFtheta, false}},
      {"equisolid", {Projection::kEquisolid, false}},
      {"orthographic", {Projection::kOrthographic, false}}};
  if (may_compare) choices["auto"] = {std::nullopt, true};
  return command.choice("--lens-model", option, choices,
                        "Projection of the lenses; fisheye (OpenCV's) and ftheta are alike" + more);
}

}  // namespace raystage::cli
