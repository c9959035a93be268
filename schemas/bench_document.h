// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "schemas/option_values.h"

namespace raystage {

/// schema "raystage/bench/1": ways of rendering that are measured against each other.
struct BenchDocument {
  struct Setting {
    std::string label;  ///< names it in tables and charts; unique
    std::string method;
    OptionValues options;               ///< of the method
    std::optional<double> focal_depth;  ///< metres in front of the array; absent: as asked for
    bool operator==(const Setting&) const = default;
  };
  std::vector<Setting> settings;
};

/// Throws Error with file, JSON pointer, what was found and what is allowed.
BenchDocument read_bench(const std::filesystem::path& file);

/// The same in memory; `name` stands for the file in errors.
BenchDocument parse_bench(std::string_view text, std::string_view name);
std::string format_bench(const BenchDocument& bench);

}  // namespace raystage
