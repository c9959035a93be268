// SPDX-License-Identifier: Apache-2.0
// The parts of `raystage calibrate`.
#pragma once

#include "cli/command_line_parsing.h"

namespace raystage::cli {

Subcommand declare_calibrate_lens(CommandLine& calibrate);
Subcommand declare_calibrate_geometry(CommandLine& calibrate);
Subcommand declare_calibrate_color(CommandLine& calibrate);
Subcommand declare_calibrate_compare(CommandLine& calibrate);

}  // namespace raystage::cli
