// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "schemas/option_values.h"

namespace raystage {

/// One option of a reconstruction method: what it is called, what it may be, what it is unless
/// given. Made by the functions below.
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
  double number = 0;           ///< fallback of flags (0, 1) and numbers
  double least = 0, most = 0;  ///< of numbers, both allowed
  std::string_view text;       ///< fallback of choices and texts
  std::string_view choices;    ///< of kChoice, separated by '|'
  std::string_view help;       ///< for people, with the unit
};

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

/// What a method's options are in one rendering: those given, checked, and the others as they are
/// unless given.
class MethodOptions {
 public:
  MethodOptions() = default;
  /// Throws Error (bad input) for a name that is none of `specs`, a value of another kind or out of
  /// its range; `where` says in the error where they stand.
  MethodOptions(std::span<const OptionSpec> specs, const OptionValues& given,
                std::string_view where);

  // Asking for an option that the method has not declared breaks an invariant (std::logic_error).
  bool flag(std::string_view name) const;
  int whole(std::string_view name) const;
  double number(std::string_view name) const;
  const std::string& text(std::string_view name) const;

  /// All of them, e.g. for a fingerprint.
  const OptionValues& values() const { return values_; }

 private:
  OptionValues values_;
};

/// "NAME=VALUE" as it stands on a command line: true and false, numbers, else text. Throws Error
/// (bad input) where there is no '=' or no name.
OptionValues::value_type option_from_text(std::string_view text);

/// "NAME=VALUE,NAME=VALUE", none where empty. Throws Error (bad input) as above, and for a name
/// that comes twice.
OptionValues options_from_text(std::string_view text);
/// The same the other way, by name.
std::string options_to_text(const OptionValues& options);

/// A line for people: name, unless-given value, range, help.
std::string describe_option(const OptionSpec& spec);

}  // namespace raystage
