// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdlib>
#include <string>
#include <string_view>

#include "cli/command.h"
#include "cli/version.h"
#include "raystage_version.h"

namespace raystage {

/// Throws where an option was given a number that is none ("nan", "inf"): CLI11's ranges let it by.
inline void refuse_non_finite(const CLI::App& app) {
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_positional()) continue;
    for (const std::string& text : option->results()) {
      char* end = nullptr;
      const double value = std::strtod(text.c_str(), &end);
      if (end != text.c_str() && *end == '\0' && !std::isfinite(value)) {
        throw CLI::ValidationError(option->get_name(),
                                   "found " + text + ", allowed: finite numbers");
      }
    }
  }
}

/// Parses the command line into what `app`'s options are bound to and runs `body`.
/// --help and --version: printed, exit code 0. Bad usage: said on stderr, exit code 2.
inline int parse_and_run(CLI::App& app, int argc, char** argv, std::string_view name,
                         const CommandBody& body, OnSignal on_signal = OnSignal::kAbort) {
  app.set_version_flag("--version", version_text, "Print version, kernels and libraries");
  app.get_formatter()->column_width(34);
  try {
    app.parse(argc, argv);
    refuse_non_finite(app);
  } catch (const CLI::ParseError& error) {
    const bool asked_for = error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success);
    app.exit(error);
    return static_cast<int>(asked_for ? ExitCode::kSuccess : ExitCode::kBadInput);
  }
  return run_command(name, body, on_signal);
}

}  // namespace raystage
