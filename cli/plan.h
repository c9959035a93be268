// SPDX-License-Identifier: Apache-2.0
// The parts of `raystage plan`.
#pragma once

#include <filesystem>
#include <string>

#include "cli/command_line_parsing.h"
#include "rig/rig.h"

namespace raystage::cli {

inline constexpr double kPercent = 100;

/// A rig, and its name or else that of its file.
struct NamedRig {
  std::string name;
  rig::Rig rig;
};
/// Reads a rig, or that of a take. Throws Error (bad input) as the documents do.
NamedRig read_named_rig(const std::filesystem::path& path);

Subcommand declare_plan_array(CommandLine& plan);
Subcommand declare_plan_check(CommandLine& plan);
Subcommand declare_plan_coverage(CommandLine& plan);
Subcommand declare_plan_epi(CommandLine& plan);
Subcommand declare_plan_resolution(CommandLine& plan);

}  // namespace raystage::cli
