// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>

#include "calibrate/color_from_takes.h"

namespace raystage {

/// The options of `raystage calibrate color`.
struct CalibrateColorOptions {
  ColorFromTakesSettings settings;
  std::filesystem::path output, start, sheet, sheet_of;
  bool force = false, json = false, quiet = false;
  int threads = 0;
};

void add_calibrate_color_options(CLI::App& app, CalibrateColorOptions& o);

}  // namespace raystage
