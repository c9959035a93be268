// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <initializer_list>
#include <string_view>

#include "cli/command.h"

namespace raystage {

/// Throws for an option whose number is not finite ("nan", "inf"): CLI11's ranges accept it.
void reject_non_finite(const CLI::App& app);

/// A deprecated alias of an option: "--leave-out" for "--exclude-cameras".
struct FormerOption {
  std::string_view former, name;
};

/// Parses the command line into the variables of `app`'s options and runs `body`. Prints --help and
/// --version (exit code 0) and usage errors (exit code 2). To the advice of an Error it appends the
/// options of `app` that Error::settings() name: "(--focal-depth)" for "focal_depth".
/// `former`: aliases that are accepted, with a note on stderr, and are not in the help.
int parse_and_run(CLI::App& app, int argc, char** argv, std::string_view name,
                  const CommandBody& body, OnSignal on_signal = OnSignal::kAbort,
                  std::initializer_list<FormerOption> former = {});

}  // namespace raystage
