// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "cli/command_line.h"
#include "schemas/geometry.h"

namespace raystage::cli {

/// The choice of a lens model.
struct LensModelOption {
  std::optional<schemas::Projection> projection;  ///< none: not given, or "auto"
  bool compares = false;                          ///< "auto"
};

/// Adds --lens-model. `more`: the end of its help. `may_compare`: whether "auto" is a choice.
Option add_lens_model_option(CommandLine& command, LensModelOption& option, bool may_compare,
                             const std::string& more);

}  // namespace raystage::cli
