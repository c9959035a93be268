// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace raystage {

/// schema "raystage/planes/1": flat polygons that stand for objects.
struct PlanesDocument {
  struct Plane {
    std::string id;                              ///< unique
    std::vector<std::array<double, 3>> corners;  ///< 3 to 64, around it; world, metres
    bool operator==(const Plane&) const = default;
  };
  std::vector<Plane> planes;
};

/// Throws Error with file, JSON pointer, what was found and what is allowed. Whether corners lie in
/// a plane is not looked at.
PlanesDocument read_planes(const std::filesystem::path& file);

/// The same in memory; `name` stands for the file in errors.
PlanesDocument parse_planes(std::string_view text, std::string_view name);
std::string format_planes(const PlanesDocument& planes);

}  // namespace raystage
