// SPDX-License-Identifier: Apache-2.0
// The parts of `raystage plan`.
#pragma once

#include "cli/command_line_parsing.h"

namespace raystage::cli {

Subcommand declare_plan_check(CommandLine& plan);
Subcommand declare_plan_resolution(CommandLine& plan);

}  // namespace raystage::cli
