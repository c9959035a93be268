// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <string>
#include <vector>

namespace raystage {

/// Adds an option with a closed list of words. CLI11's own transformer would show users the
/// enumerators' numbers.
template <class T>
CLI::Option* add_choice(CLI::App& app, const std::string& name, T& value,
                        const std::map<std::string, T>& choices, const std::string& help) {
  std::string names;
  std::vector<std::string> words;
  for (const auto& [word, unused] : choices) {
    words.push_back(word);
    names += (names.empty() ? "" : "|") + word;
  }
  return app
      .add_option_function<std::string>(
          name, [&value, choices](const std::string& word) { value = choices.at(word); }, help)
      ->check(CLI::IsMember(words).description(""))
      ->type_name(names);
}

}  // namespace raystage
