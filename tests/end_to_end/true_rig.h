// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "testing/test_folder.h"

namespace raystage::testing {

/// Writes the true rig in truth.json to a separate document.
inline std::string write_true_rig(const std::filesystem::path& take) {
  const auto truth = nlohmann::json::parse(read_text(take / "truth.json"));
  const std::filesystem::path file = take / "true_rig.json";
  write_text(file, truth.at("rig").dump());
  return file.string();
}

}  // namespace raystage::testing
