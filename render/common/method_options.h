// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "schemas/option_values.h"

namespace raystage::render {

/// One option of a reconstruction method: its name, allowed values and default. Create it with the
/// functions below.
struct OptionSpec {
  enum class Kind {
    kFlag,     ///< true or false
    kInteger,  ///< a whole number
    kNumber,   ///< any number
    kChoice,   ///< one of several words
    kText      ///< any text, e.g. a file
  };
  std::string_view name;
  Kind kind = Kind::kNumber;
  double number = 0;             ///< default of flags (0, 1) and numbers
  double least = 0, most = 0;    ///< range of numbers, both ends allowed
  std::string_view text;         ///< default of choices and texts
  std::string_view choices;      ///< of kChoice, separated by '|'
  std::string_view help;         ///< for the user, with the unit
  std::string_view former = {};  ///< deprecated alias of the name

  /// Returns the name by which fingerprints know the option: a renamed one keeps its own.
  constexpr std::string_view fingerprint_name() const { return former.empty() ? name : former; }
};

/// Returns an option that was renamed: `former` is accepted as well.
constexpr OptionSpec renamed_option(std::string_view former, OptionSpec spec) {
  spec.former = former;
  return spec;
}

constexpr OptionSpec flag_option(std::string_view name, bool fallback, std::string_view help) {
  return {name, OptionSpec::Kind::kFlag, fallback ? 1.0 : 0.0, 0, 1, {}, {}, help};
}
constexpr OptionSpec integer_option(std::string_view name, double fallback, double least,
                                    double most, std::string_view help) {
  return {name, OptionSpec::Kind::kInteger, fallback, least, most, {}, {}, help};
}
constexpr OptionSpec number_option(std::string_view name, double fallback, double least,
                                   double most, std::string_view help) {
  return {name, OptionSpec::Kind::kNumber, fallback, least, most, {}, {}, help};
}
constexpr OptionSpec choice_option(std::string_view name, std::string_view fallback,
                                   std::string_view choices, std::string_view help) {
  return {name, OptionSpec::Kind::kChoice, 0, 0, 0, fallback, choices, help};
}
constexpr OptionSpec text_option(std::string_view name, std::string_view fallback,
                                 std::string_view help) {
  return {name, OptionSpec::Kind::kText, 0, 0, 0, fallback, {}, help};
}

/// The options of a method in one rendering: the given values, validated, and the defaults of the
/// others.
class MethodOptions {
 public:
  MethodOptions() = default;
  /// Throws Error (bad input) for a name that is not in `specs` and for a value of the wrong kind
  /// or out of range. `where` is the origin of the options, for the message.
  MethodOptions(std::span<const OptionSpec> specs, const schemas::OptionValues& given,
                std::string_view where);

  // Reading an option that the method has not declared violates an invariant (std::logic_error).
  bool flag(std::string_view name) const;
  int integer(std::string_view name) const;
  double number(std::string_view name) const;
  const std::string& text(std::string_view name) const;

  /// Returns all options, e.g. for a fingerprint.
  const schemas::OptionValues& values() const { return values_; }

 private:
  schemas::OptionValues values_;
};

/// Parses "NAME=VALUE" as on a command line; the value is true, false, a number or else text.
/// Throws Error (bad input) without '=' or without a name.
schemas::OptionValues::value_type option_from_text(std::string_view text);

/// Parses "NAME=VALUE,NAME=VALUE"; an empty text gives no options. Throws Error (bad input) as
/// option_from_text(), and for a repeated name.
schemas::OptionValues options_from_text(std::string_view text);
/// Returns the options as options_from_text() reads them, sorted by name.
std::string options_to_text(const schemas::OptionValues& options);

/// Returns a help line for the user: name, default, range, help.
std::string describe_option(const OptionSpec& spec);

}  // namespace raystage::render
