// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "schemas/option_values.h"

namespace raystage::schemas {

/// Schema "raystage/bench/1": rendering settings that a benchmark compares.
struct BenchDocument {
  struct Setting {
    std::string label;  ///< name in tables and charts; unique
    std::string method;
    OptionValues options;               ///< options of the method
    std::optional<double> focal_depth;  ///< metres in front of the array; nullopt: as requested
    bool operator==(const Setting&) const = default;
  };
  std::vector<Setting> settings;
};

/// Reads the document. Throws Error (bad input) with the file, the JSON pointer, the value found
/// and what is allowed.
BenchDocument read_bench(const std::filesystem::path& file);

/// Parses and formats the document in memory; errors use `name` as the file name.
BenchDocument parse_bench(std::string_view text, std::string_view name);
std::string format_bench(const BenchDocument& bench);

}  // namespace raystage::schemas
