// SPDX-License-Identifier: Apache-2.0
// The parts of `raystage plan`.
#pragma once

#include <filesystem>
#include <string>

#include "cli/command_line_parsing.h"
#include "planning/named_rig.h"

namespace raystage::cli {

inline constexpr double kPercent = 100;

/// Reads a rig, or that of a take, with its name or else that of its file. Throws Error (bad input)
/// as the documents do.
planning::NamedRig read_named_rig(const std::filesystem::path& path);

Subcommand declare_plan_array(CommandLine& plan);
Subcommand declare_plan_check(CommandLine& plan);
Subcommand declare_plan_coverage(CommandLine& plan);
Subcommand declare_plan_epi(CommandLine& plan);
Subcommand declare_plan_resolution(CommandLine& plan);

}  // namespace raystage::cli
