// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace raystage::schemas {

/// Schema "raystage/planes/1": flat polygons that approximate objects.
struct PlanesDocument {
  struct Plane {
    std::string id;                              ///< unique
    std::vector<std::array<double, 3>> corners;  ///< 3 to 64, in order around it; world, metres
    bool operator==(const Plane&) const = default;
  };
  std::vector<Plane> planes;
};

/// Reads the document. Throws Error (bad input) with the file, the JSON pointer, the value found
/// and what is allowed. Does not check that the corners are coplanar.
PlanesDocument read_planes(const std::filesystem::path& file);

/// Parses and formats the document in memory; errors use `name` as the file name.
PlanesDocument parse_planes(std::string_view text, std::string_view name);
std::string format_planes(const PlanesDocument& planes);

}  // namespace raystage::schemas
