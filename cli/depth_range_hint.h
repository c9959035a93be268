// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <system_error>

#include "base/contained_path.h"
#include "base/error.h"
#include "cli/printing.h"
#include "schemas/take_document.h"

namespace raystage::cli {

/// Prints how to measure the depth range of a take that states none; nothing for another folder.
inline void print_depth_range_hint(const std::filesystem::path& folder) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(folder / "take.json", ignored)) return;
  try {
    const schemas::TakeDocument take = schemas::read_take(ContainedPath{folder, "take.json"});
    if (take.depth_range || take.cameras.size() < 2) return;
  } catch (const Error&) {
    return;  // a hint is no reason to fail
  }
  print(
      "The take states no depth range, which depth, plane_sweep and auto need. To measure it:\n"
      "  raystage plan epi '{}' --write\n",
      folder.string());
}

}  // namespace raystage::cli
