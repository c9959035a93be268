// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <filesystem>

#include "testing/test_paths.h"

namespace raystage::testing {

/// Returns the folder of captured light fields for tests: $RAYSTAGE_DATA, otherwise next to the
/// project. It may not exist.
inline std::filesystem::path test_data() {
  const char* data = std::getenv("RAYSTAGE_DATA");
  return data != nullptr ? std::filesystem::path(data) : source_folder() / ".." / "shared" / "data";
}

}  // namespace raystage::testing
