// SPDX-License-Identifier: Apache-2.0
#include "cli/command_line_parsing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <span>
#include <string>
#include <vector>

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

/// Returns the arguments in CLI11's order (last first), with former names replaced.
std::vector<std::string> current_arguments(std::span<char*> arguments, std::string_view command,
                                           std::span<const FormerOption> former) {
  std::vector<std::string> result(arguments.begin(), arguments.end());
  for (std::string& argument : result) {
    if (argument == "--") break;
    const std::string given = argument.substr(0, argument.find('='));
    const auto alias = std::ranges::find(former, given, &FormerOption::former);
    if (alias == former.end()) continue;
    argument = std::string(alias->name) + argument.substr(given.size());
    fmt::print(stderr, "raystage {}: {} is deprecated and will be removed; use {}\n", command,
               given, alias->name);
  }
  std::ranges::reverse(result);
  return result;
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
                  const CommandBody& body, OnSignal on_signal,
                  std::initializer_list<FormerOption> former) {
  app.set_version_flag("--version", version_text, "Print version, kernels and libraries");
  app.get_formatter()->column_width(34);
  try {
    const std::span arguments(argv, static_cast<std::size_t>(argc));
    app.parse(current_arguments(arguments.subspan(std::min<std::size_t>(1, arguments.size())), name,
                                {former.begin(), former.size()}));
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
