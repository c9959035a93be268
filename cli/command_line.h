// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace raystage::cli {

/// An option that was added to a CommandLine. All members return the same option. Other options are
/// given by a name, e.g. "--board" or "TAKE", and must have been added before.
class Option {
 public:
  explicit Option(CLI::Option* option) : option_(option) {}

  Option required(bool is_required = true);
  Option needs(const std::string& other);
  Option excludes(const std::string& other);
  /// Accepts numbers in [min, max], which the help lists.
  Option range(int min, int max);
  Option range(double min, double max);
  /// Accepts numbers as range() does. The help does not list the range: the description states it.
  Option limits(int min, int max);
  Option limits(double min, double max);
  Option positive();
  Option non_negative();
  /// Accepts numbers as limits() does, or `word`.
  Option word_or_limits(const std::string& word, int min, int max);
  /// Accepts these words and makes them the placeholder: a|b|c.
  Option one_of(const std::vector<std::string>& words);
  /// Accepts these words, which the help lists after the placeholder: ORDER:{a,b,c}.
  Option one_of_listed(const std::vector<std::string>& words);
  /// Accepts the texts for which `error_of` returns no error message.
  Option check(const std::function<std::string(const std::string&)>& error_of);
  Option existing_folder();
  /// Takes from `min` to `max` arguments. By default, a list takes one or more.
  Option expected(int min, int max);
  /// Makes a list take one argument, with separators between values; the option may be repeated.
  Option one_argument(char separator = '\0');
  /// Accepts commas between a list's values.
  Option comma_separated();
  /// Shows the variable's present value as the default in the help.
  Option show_default();
  /// Replaces all that the help shows between the option's name and its description.
  Option help_text(const std::string& text);

 private:
  CLI::Option* option_;
};

/// Declares, describes and parses the options of a command or subcommand. Hides the library CLI11,
/// whose headers take seconds to compile. Copies refer to the same command.
///
/// Names are listed with the placeholder of the value: "-j,--threads N", "SHOT" for a positional
/// argument. Without a placeholder the help shows the type. Variables must outlive parse().
class CommandLine {
 public:
  /// Declares a command. `name`: as a user types it, "raystage render".
  CommandLine(const std::string& description, const std::string& name);

  /// The types of variables that options can set.
  using Target = std::variant<int*, std::uint64_t*, double*, std::string*, std::filesystem::path*,
                              std::optional<int>*, std::optional<double>*, std::array<double, 3>*,
                              std::vector<int>*, std::vector<double>*, std::vector<std::string>*,
                              std::vector<std::filesystem::path>*>;

  /// Adds an option that sets `value`.
  template <class T>
  Option option(const std::string& names, T& value, const std::string& help) {
    return add(names, &value, help);
  }
  /// Adds an option that sets `value` to one of the choices, which are given by words.
  template <class T>
  Option choice(const std::string& names, T& value,
                const std::type_identity_t<std::map<std::string, T>>& choices,
                const std::string& help) {
    std::vector<std::string> words;
    for (const auto& [word, unused] : choices) words.push_back(word);
    const auto set = [&value, choices](const std::string& word) { value = choices.at(word); };
    return add_words(names, words, set, help);
  }
  /// Adds a flag that sets `value`: to true, or for a name "!--no-measure" to false.
  Option flag(const std::string& names, bool& value, const std::string& help);
  /// Adds a flag with an optional value: "--restart-markers{default}" or "--restart-markers=4".
  Option flag(const std::string& names, std::string& value, const std::string& help);
  /// Adds a flag that calls a function.
  Option flag(const std::string& names, const std::function<void()>& action,
              const std::string& help);
  /// Adds a flag that prints a text and ends the program, as --version does.
  Option text_flag(const std::string& names, const std::function<std::string()>& text,
                   const std::string& help);

  /// Returns this command line; options added to it are under a heading of their own in the help.
  CommandLine group(const std::string& heading) const;
  /// Shows the defaults of all options that are added later, as Option::show_default().
  void show_defaults();
  /// Sets the last paragraph of the help.
  void footer(const std::string& text);
  /// Calls `action` at the end of parsing. An Error that it throws is a usage error.
  void after_parsing(const std::function<void()>& action);

  /// Adds a subcommand. If there are any, exactly one must be given.
  CommandLine subcommand(const std::string& name, const std::string& description);
  /// Returns whether this subcommand was given.
  bool is_given() const;

  /// Sets the variables of the options. Returns the exit code if the program ends here: it printed
  /// --help, --version (0) or a usage error (2). Numbers that are not finite are usage errors.
  std::optional<int> parse(std::vector<std::string> arguments);
  /// Returns whether the command or its given subcommand has the option "--NAME".
  bool has_option(const std::string& name) const;

 private:
  explicit CommandLine(std::shared_ptr<CLI::App> app) : app_(std::move(app)) {}
  Option add(const std::string& names, Target target, const std::string& help);
  Option add_words(const std::string& names, const std::vector<std::string>& words,
                   const std::function<void(const std::string&)>& set, const std::string& help);
  Option finish(CLI::Option* option, const std::string& placeholder);

  std::shared_ptr<CLI::App> app_;
  std::string group_;  ///< empty: CLI11's "Options"
};

}  // namespace raystage::cli
