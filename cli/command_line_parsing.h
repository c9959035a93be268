// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <initializer_list>
#include <string_view>
#include <vector>

#include "cli/command.h"
#include "cli/command_line.h"

namespace raystage::cli {

/// A deprecated alias of an option: "--leave-out" for "--exclude-cameras".
struct FormerOption {
  std::string_view former, name;
};

/// Parses the arguments into the variables of the options and runs `body`. Prints --help and
/// --version (exit code 0) and usage errors (exit code 2). To the advice of an Error it appends the
/// options that Error::settings() names: "(--focal-depth)" for "focal_depth".
/// `former`: aliases that are accepted, with a note on stderr, and are not in the help.
int parse_and_run(CommandLine& command, int argc, char** argv, std::string_view name,
                  const CommandBody& body, OnSignal on_signal = OnSignal::kAbort,
                  std::initializer_list<FormerOption> former = {});

/// A subcommand and its body, which owns the variables of the options.
struct Subcommand {
  CommandLine command;
  CommandBody body;
};

/// Parses the arguments as above, and runs the body of the subcommand that is given.
int parse_and_run(CommandLine& command, int argc, char** argv, std::string_view name,
                  const std::vector<Subcommand>& subcommands,
                  std::initializer_list<FormerOption> former);

}  // namespace raystage::cli
