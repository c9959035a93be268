// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <filesystem>

namespace raystage {

/// For tests: light fields that others captured, where RAYSTAGE_DATA says, else beside the project;
/// may not exist.
inline std::filesystem::path test_data() {
  const char* data = std::getenv("RAYSTAGE_DATA");
  return data != nullptr ? std::filesystem::path(data)
                         : std::filesystem::path(RAYSTAGE_SOURCE_DIR) / ".." / "shared" / "data";
}

}  // namespace raystage
