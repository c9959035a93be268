// SPDX-License-Identifier: Apache-2.0
// The parts of `raystage export`.
#pragma once

#include "cli/command_line_parsing.h"

namespace raystage::cli {

Subcommand declare_export_depth(CommandLine& command);
Subcommand declare_export_images(CommandLine& command);
Subcommand declare_export_model(CommandLine& command);
Subcommand declare_export_mosaic(CommandLine& command);
Subcommand declare_export_movies(CommandLine& command);
Subcommand declare_export_multiview(CommandLine& command);
Subcommand declare_export_quilt(CommandLine& command);
Subcommand declare_export_rig(CommandLine& command);

}  // namespace raystage::cli
