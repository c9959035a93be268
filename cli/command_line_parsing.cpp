// SPDX-License-Identifier: Apache-2.0
#include "cli/command_line_parsing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <span>
#include <string>

#include "cli/printing.h"

namespace raystage::cli {
namespace {

/// Returns the options of the command that the error's settings name: " (--missing, --frames)".
std::string options_for(const Error& error, const CommandLine& command) {
  std::string options;
  for (const std::string& setting : error.settings()) {
    std::string flag = "--" + setting;
    std::ranges::replace(flag, '_', '-');
    if (command.has_option(flag)) options += (options.empty() ? " (" : ", ") + flag;
  }
  return options.empty() ? options : options + ")";
}

Error with_options(const Error& error, const CommandLine& command) {
  const std::string advice = error.what_to_do() + options_for(error, command);
  return error.exit_code() == ExitCode::kBadInput
             ? Error::bad_input(error.what_happened(), error.where(), advice)
             : Error::failed(error.what_happened(), error.where(), advice);
}

/// Returns the arguments with former names replaced.
std::vector<std::string> current_arguments(std::span<char*> arguments, std::string_view command,
                                           std::span<const FormerOption> former) {
  std::vector<std::string> result(arguments.begin(), arguments.end());
  for (std::string& argument : result) {
    if (argument == "--") break;
    const std::string given = argument.substr(0, argument.find('='));
    const auto alias = std::ranges::find(former, given, &FormerOption::former);
    if (alias == former.end()) continue;
    argument = std::string(alias->name) + argument.substr(given.size());
    print_error("raystage {}: {} is deprecated and will be removed; use {}\n", command, given,
                alias->name);
  }
  return result;
}

}  // namespace

int parse_and_run(CommandLine& command, int argc, char** argv, std::string_view name,
                  const CommandBody& body, OnSignal on_signal,
                  std::initializer_list<FormerOption> former) {
  const std::span arguments(argv, static_cast<std::size_t>(argc));
  const std::optional<int> end =
      command.parse(current_arguments(arguments.subspan(std::min<std::size_t>(1, arguments.size())),
                                      name, {former.begin(), former.size()}));
  if (end) return *end;
  const CommandBody with_advice = [&](std::stop_token stop) {
    try {
      return body(std::move(stop));
    } catch (const Error& error) {
      throw with_options(error, command);
    }
  };
  return run_command(name, with_advice, on_signal);
}

int parse_and_run(CommandLine& command, int argc, char** argv, std::string_view name,
                  const std::vector<Subcommand>& subcommands,
                  std::initializer_list<FormerOption> former) {
  const CommandBody body = [&](const std::stop_token& stop) {
    const auto is_given = [](const Subcommand& subcommand) {
      return subcommand.command.is_given();
    };
    return std::ranges::find_if(subcommands, is_given)->body(stop);
  };
  return parse_and_run(command, argc, argv, name, body, OnSignal::kAbort, former);
}

}  // namespace raystage::cli
