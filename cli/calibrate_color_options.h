// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "calibrate/color_from_takes.h"
#include "cli/command_line.h"

namespace raystage::cli {

/// The options of `raystage calibrate color`.
struct CalibrateColorOptions {
  calibrate::ColorFromTakesOptions settings;
  std::filesystem::path output, start, sheet, sheet_of;
  bool force = false, json = false, quiet = false;
  int threads = 0;
};

void add_calibrate_color_options(CommandLine& command, CalibrateColorOptions& o);

}  // namespace raystage::cli
