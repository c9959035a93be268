// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "cli/command_line.h"
#include "schemas/geometry.h"

namespace raystage::cli {

/// The choice of a lens model.
struct LensModelOption {
  struct Choice {
    std::optional<schemas::Projection> projection;  ///< none: not given, or "auto"
    bool compares = false;                          ///< "auto"
  };
  Choice choice;
  std::optional<double> half_angle_deg;
};

/// Adds --lens-model and --half-angle-deg, and returns the first. `more`: the end of its help.
/// `may_compare`: whether "auto" is a choice.
Option add_lens_model_options(CommandLine& command, LensModelOption& option, bool may_compare,
                              const std::string& more);

}  // namespace raystage::cli
