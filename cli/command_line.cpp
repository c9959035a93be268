// SPDX-License-Identifier: Apache-2.0
#include "cli/command_line.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>
#include <utility>

#include "base/error.h"
#include "cli/version.h"

namespace raystage::cli {
namespace {

constexpr int kHelpColumn = 34;

/// Splits "-j,--threads N" into names and placeholder.
std::pair<std::string, std::string> split(const std::string& names) {
  const std::size_t space = names.find(' ');
  if (space == std::string::npos) return {names, ""};
  return {names.substr(0, space), names.substr(space + 1)};
}

/// The command itself, which knows which options of its subcommands are lists of numbers.
struct RootApp : CLI::App {
  using CLI::App::App;
  std::set<const CLI::Option*> number_lists;
};

RootApp& root_of(CLI::App& app) {
  CLI::App* root = &app;
  while (root->get_parent() != nullptr) root = root->get_parent();
  return static_cast<RootApp&>(*root);
}

bool is_number(const std::string& text) {
  char* end = nullptr;
  std::strtod(text.c_str(), &end);
  return end != text.c_str() && *end == '\0';
}

/// Gives lists of numbers the numbers that follow them: "--shares 100 99 RIG" becomes "--shares=100
/// --shares=99 RIG". By itself CLI11 would take all arguments up to the next option.
std::vector<std::string> with_divided_lists(RootApp& root, std::vector<std::string> arguments) {
  std::vector<std::string> divided;
  CLI::App* app = &root;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& argument = arguments[i];
    const auto given = app->get_subcommands(
        [&](const CLI::App* subcommand) { return subcommand->get_name() == argument; });
    if (!given.empty()) app = given.front();
    CLI::Option* option = argument.starts_with('-') ? app->get_option_no_throw(argument) : nullptr;
    const bool is_list = option != nullptr && root.number_lists.contains(option) &&
                         option->get_items_expected_max() >= CLI::detail::expected_max_vector_size;
    if (!is_list || i + 1 == arguments.size() || !is_number(arguments[i + 1])) {
      divided.push_back(argument);
      continue;
    }
    option->allow_extra_args(false);
    while (i + 1 < arguments.size() && is_number(arguments[i + 1])) {
      divided.push_back(argument);
      divided.push_back(arguments[++i]);
    }
  }
  return divided;
}

/// Throws for "nan" and "inf", which CLI11's ranges accept.
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
  for (const CLI::App* given : app.get_subcommands()) reject_non_finite(*given);
}

bool has_option_of(const CLI::App& app, const std::string& name) {
  if (app.get_option_no_throw(name) != nullptr) return true;
  return std::ranges::any_of(app.get_subcommands(),
                             [&](const CLI::App* given) { return has_option_of(*given, name); });
}

}  // namespace

Option Option::required(bool is_required) { return Option(option_->required(is_required)); }
Option Option::needs(const std::string& other) { return Option(option_->needs(other)); }
Option Option::excludes(const std::string& other) { return Option(option_->excludes(other)); }

Option Option::range(int min, int max) { return Option(option_->check(CLI::Range(min, max))); }
Option Option::range(double min, double max) {
  return Option(option_->check(CLI::Range(min, max)));
}
Option Option::limits(int min, int max) { return check(CLI::Range(min, max)); }
Option Option::limits(double min, double max) { return check(CLI::Range(min, max)); }
Option Option::positive() { return Option(option_->check(CLI::PositiveNumber)); }
Option Option::non_negative() { return Option(option_->check(CLI::NonNegativeNumber)); }

Option Option::word_or_limits(const std::string& word, int min, int max) {
  return check([word, range = CLI::Range(min, max)](const std::string& text) {
    return text == word ? "" : range(text);
  });
}

Option Option::one_of(const std::vector<std::string>& words) {
  option_->type_name(CLI::detail::join(words, "|"));
  return check(CLI::IsMember(words));
}

Option Option::one_of_listed(const std::vector<std::string>& words) {
  return Option(option_->check(CLI::IsMember(words)));
}

Option Option::check(const std::function<std::string(const std::string&)>& error_of) {
  return Option(option_->check(error_of));
}

Option Option::existing_folder() { return Option(option_->check(CLI::ExistingDirectory)); }

Option Option::expected(int min, int max) {
  return Option(min == max ? option_->expected(min) : option_->expected(min, max));
}

Option Option::one_argument(char separator) {
  return Option(option_->delimiter(separator)->allow_extra_args(false));
}
Option Option::comma_separated() { return Option(option_->delimiter(',')); }
Option Option::show_default() { return Option(option_->capture_default_str()); }
Option Option::help_text(const std::string& text) { return Option(option_->option_text(text)); }

CommandLine::CommandLine(const std::string& description, const std::string& name)
    : app_(std::make_shared<RootApp>(description, name)) {
  app_->get_formatter()->column_width(kHelpColumn);
}

Option CommandLine::finish(CLI::Option* option, const std::string& placeholder) {
  if (!placeholder.empty()) option->type_name(placeholder);
  if (!group_.empty()) option->group(group_);
  return Option(option);
}

Option CommandLine::add(const std::string& names, Target target, const std::string& help) {
  const auto [all, placeholder] = split(names);
  const auto add_to = [&, &option_names = all](auto* value) {
    CLI::Option* option = app_->add_option(option_names, *value, help);
    using Value = std::remove_pointer_t<decltype(value)>;
    if constexpr (std::is_same_v<Value, std::vector<double>> ||
                  std::is_same_v<Value, std::vector<int>>) {
      root_of(*app_).number_lists.insert(option);
    }
    return option;
  };
  return finish(std::visit(add_to, target), placeholder);
}

Option CommandLine::add_words(const std::string& names, const std::vector<std::string>& words,
                              const std::function<void(const std::string&)>& set,
                              const std::string& help) {
  return finish(app_->add_option_function(names, set, help), "").one_of(words);
}

Option CommandLine::flag(const std::string& names, bool& value, const std::string& help) {
  return finish(app_->add_flag(names, value, help), "");
}

Option CommandLine::flag(const std::string& names, std::string& value, const std::string& help) {
  const auto [all, placeholder] = split(names);
  return finish(app_->add_flag(all, value, help), placeholder);
}

Option CommandLine::flag(const std::string& names, const std::function<void()>& action,
                         const std::string& help) {
  return finish(app_->add_flag_callback(names, action, help), "");
}

Option CommandLine::text_flag(const std::string& names, const std::function<std::string()>& text,
                              const std::string& help) {
  return flag(
      names, [text] { throw CLI::CallForVersion(text(), 0); }, help);
}

CommandLine CommandLine::group(const std::string& heading) const {
  CommandLine copy = *this;
  copy.group_ = heading;
  return copy;
}

void CommandLine::show_defaults() { app_->option_defaults()->always_capture_default(); }

void CommandLine::footer(const std::string& text) { app_->footer(text); }

void CommandLine::after_parsing(const std::function<void()>& action) {
  app_->final_callback([action] {
    try {
      action();
    } catch (const Error& error) {
      throw CLI::ValidationError(error.where(), error.what_happened() + ". " + error.what_to_do());
    }
  });
}

CommandLine CommandLine::subcommand(const std::string& name, const std::string& description) {
  app_->require_subcommand(1);
  return CommandLine({app_, app_->add_subcommand(name, description)});
}

bool CommandLine::is_given() const { return app_->parsed(); }

std::optional<int> CommandLine::parse(std::vector<std::string> arguments) {
  app_->set_version_flag("--version", version_text, "Print version, kernels and libraries");
  try {
    arguments = with_divided_lists(root_of(*app_), std::move(arguments));
    std::ranges::reverse(arguments);  // CLI11 takes the last one first
    app_->parse(std::move(arguments));
    reject_non_finite(*app_);
  } catch (const CLI::ParseError& error) {
    app_->exit(error);
    const bool is_success = error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success);
    return static_cast<int>(is_success ? ExitCode::kSuccess : ExitCode::kBadInput);
  }
  return std::nullopt;
}

bool CommandLine::has_option(const std::string& name) const { return has_option_of(*app_, name); }

}  // namespace raystage::cli
