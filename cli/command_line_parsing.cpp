// SPDX-License-Identifier: Apache-2.0
#include "cli/command_line_parsing.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>

#include "cli/version.h"

namespace raystage {
namespace {

bool has_option(const CLI::App& app, const std::string& flag) {
  if (app.get_option_no_throw(flag) != nullptr) return true;
  const auto chosen = app.get_subcommands();
  return std::ranges::any_of(chosen, [&](const CLI::App* sub) { return has_option(*sub, flag); });
}

/// Returns the options of the command that the error's settings name: " (--missing, --frames)".
std::string options_for(const Error& error, const CLI::App& app) {
  std::string options;
  for (const std::string& setting : error.settings()) {
    std::string flag = "--" + setting;
    std::ranges::replace(flag, '_', '-');
    if (has_option(app, flag)) options += (options.empty() ? " (" : ", ") + flag;
  }
  return options.empty() ? options : options + ")";
}

Error with_options(const Error& error, const CLI::App& app) {
  const std::string advice = error.what_to_do() + options_for(error, app);
  return error.exit_code() == ExitCode::kBadInput
             ? Error::bad_input(error.what_happened(), error.where(), advice)
             : Error::failed(error.what_happened(), error.where(), advice);
}

}  // namespace

void reject_non_finite(const CLI::App& app) {
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

int parse_and_run(CLI::App& app, int argc, char** argv, std::string_view name,
                  const CommandBody& body, OnSignal on_signal) {
  app.set_version_flag("--version", version_text, "Print version, kernels and libraries");
  app.get_formatter()->column_width(34);
  try {
    app.parse(argc, argv);
    reject_non_finite(app);
  } catch (const CLI::ParseError& error) {
    const bool asked_for = error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success);
    app.exit(error);
    return static_cast<int>(asked_for ? ExitCode::kSuccess : ExitCode::kBadInput);
  }
  const CommandBody with_advice = [&](std::stop_token stop) {
    try {
      return body(std::move(stop));
    } catch (const Error& error) {
      throw with_options(error, app);
    }
  };
  return run_command(name, with_advice, on_signal);
}

}  // namespace raystage
