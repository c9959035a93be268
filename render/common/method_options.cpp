// SPDX-License-Identifier: Apache-2.0
#include "render/common/method_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "base/error.h"

namespace raystage::render {
namespace {

using Kind = OptionSpec::Kind;

std::vector<std::string_view> words_of(std::string_view choices) {
  std::vector<std::string_view> words;
  while (!choices.empty()) {
    const std::size_t end = std::min(choices.find('|'), choices.size());
    words.push_back(choices.substr(0, end));
    choices.remove_prefix(std::min(end + 1, choices.size()));
  }
  return words;
}

std::string allowed_values(const OptionSpec& spec) {
  switch (spec.kind) {
    case Kind::kFlag:
      return "true or false";
    case Kind::kInteger:
      return fmt::format("a whole number from {} to {}", spec.least, spec.most);
    case Kind::kNumber:
      return fmt::format("a number from {} to {}", spec.least, spec.most);
    case Kind::kChoice:
      return fmt::format("{}", fmt::join(words_of(spec.choices), ", "));
    case Kind::kText:
      break;
  }
  return "text";
}

schemas::OptionValue fallback(const OptionSpec& spec) {
  if (spec.kind == Kind::kFlag) return spec.number != 0;
  if (spec.kind == Kind::kChoice || spec.kind == Kind::kText) return std::string(spec.text);
  return spec.number;
}

bool fits(const OptionSpec& spec, const schemas::OptionValue& value) {
  if (spec.kind == Kind::kFlag) return std::holds_alternative<bool>(value);
  if (spec.kind == Kind::kInteger || spec.kind == Kind::kNumber) {
    const double* number = std::get_if<double>(&value);
    return number != nullptr && *number >= spec.least && *number <= spec.most &&
           (spec.kind == Kind::kNumber || std::trunc(*number) == *number);
  }
  const std::string* text = std::get_if<std::string>(&value);
  if (text == nullptr || spec.kind == Kind::kText) return text != nullptr;
  return std::ranges::count(words_of(spec.choices), *text) > 0;
}

std::string shown(const schemas::OptionValue& value) {
  if (const bool* flag = std::get_if<bool>(&value)) return *flag ? "true" : "false";
  if (const double* number = std::get_if<double>(&value)) return fmt::format("{}", *number);
  return "'" + std::get<std::string>(value) + "'";
}

template <class T>
const T& value_in(const schemas::OptionValues& values, std::string_view name) {
  const auto found = values.find(std::string(name));
  if (found != values.end())
    if (const T* value = std::get_if<T>(&found->second)) return *value;
  throw std::logic_error("the method has no such option: " + std::string(name));
}

}  // namespace

MethodOptions::MethodOptions(std::span<const OptionSpec> specs, const schemas::OptionValues& given,
                             std::string_view where) {
  for (const OptionSpec& spec : specs) values_.emplace(spec.name, fallback(spec));
  for (const auto& [name, value] : given) {
    const auto spec = std::ranges::find_if(specs, [&name = name](const OptionSpec& known) {
      return name == known.name || (name == known.former && !name.empty());
    });
    if (spec == specs.end()) {
      std::vector<std::string_view> names;
      for (const OptionSpec& known : specs) names.push_back(known.name);
      throw Error::bad_input("there is no option '" + name + "'", std::string(where),
                             names.empty() ? "The method has no options; remove it"
                                           : fmt::format("Options: {}", fmt::join(names, ", ")));
    }
    // A number is accepted where a text is required: a folder may be called 7.
    schemas::OptionValue taken = value;
    if (spec->kind == Kind::kText && std::holds_alternative<double>(value)) {
      taken = fmt::format("{}", std::get<double>(value));
    }
    if (!fits(*spec, taken)) {
      throw Error::bad_input("found " + shown(value) + ", allowed: " + allowed_values(*spec),
                             std::string(where) + " option " + name, std::string(spec->help));
    }
    if (name != spec->name && given.contains(std::string(spec->name))) {
      throw Error::bad_input("'" + name + "' is the former name of '" + std::string(spec->name) +
                                 "', which is given as well",
                             std::string(where), "Remove one of them");
    }
    values_[std::string(spec->name)] = taken;
  }
}

bool MethodOptions::flag(std::string_view name) const { return value_in<bool>(values_, name); }

double MethodOptions::number(std::string_view name) const {
  return value_in<double>(values_, name);
}

int MethodOptions::integer(std::string_view name) const { return static_cast<int>(number(name)); }

const std::string& MethodOptions::text(std::string_view name) const {
  return value_in<std::string>(values_, name);
}

schemas::OptionValues::value_type option_from_text(std::string_view text) {
  const std::size_t sign = text.find('=');
  if (sign == std::string_view::npos || sign == 0) {
    throw Error::bad_input("found '" + std::string(text) + "', allowed: NAME=VALUE", "option",
                           "Write, for example, planes=96");
  }
  const std::string name(text.substr(0, sign));
  const std::string_view value = text.substr(sign + 1);
  if (value == "true" || value == "false") return {name, value == "true"};
  double number = 0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (error == std::errc{} && end == value.data() + value.size() && std::isfinite(number)) {
    return {name, number};
  }
  return {name, std::string(value)};
}

schemas::OptionValues options_from_text(std::string_view text) {
  schemas::OptionValues options;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(','), text.size());
    const auto [name, value] = option_from_text(text.substr(0, end));
    if (!options.emplace(name, value).second) {
      throw Error::bad_input("found '" + name + "' twice, allowed: once", "option", "Give it once");
    }
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return options;
}

std::string options_to_text(const schemas::OptionValues& options) {
  std::string text;
  for (const auto& [name, value] : options) {
    const std::string* word = std::get_if<std::string>(&value);
    text += (text.empty() ? "" : ",") + name + "=" + (word != nullptr ? *word : shown(value));
  }
  return text;
}

std::string describe_option(const OptionSpec& spec) {
  const schemas::OptionValue value = fallback(spec);
  const std::string given_default =
      spec.kind == Kind::kText && spec.text.empty() ? "" : " = " + shown(value);
  return fmt::format("{}{} ({}): {}", spec.name, given_default, allowed_values(spec), spec.help);
}

}  // namespace raystage::render
