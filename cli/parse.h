// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string_view>

#include "cli/command.h"
#include "raystage_version.h"

namespace raystage {

/// Parses the command line into what `app`'s options are bound to and runs `body`.
/// --help and --version: printed, exit code 0. Bad usage: said on stderr, exit code 2.
inline int parse_and_run(CLI::App& app, int argc, char** argv, std::string_view name,
                         const CommandBody& body) {
  app.set_version_flag("--version", "raystage " RAYSTAGE_VERSION, "Print the version");
  app.get_formatter()->column_width(34);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const bool asked_for = error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success);
    app.exit(error);
    return static_cast<int>(asked_for ? ExitCode::kSuccess : ExitCode::kBadInput);
  }
  return run_command(name, body);
}

}  // namespace raystage
