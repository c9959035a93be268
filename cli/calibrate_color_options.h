// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

namespace raystage {

/// What users tell `raystage calibrate color`.
struct CalibrateColorOptions {
  std::vector<std::filesystem::path> takes;
  std::filesystem::path chart, scene, output, start, dark, sheet, sheet_of;
  std::string reference;
  std::vector<double> exposures;
  double focal_depth = 0, near = 0, far = 0;  // metres; 0: not given
  bool neutral = false, vignetting = false, flat_field = false, force = false, json = false,
       quiet = false, use_published_values = false;
  int threads = 0;
};

void add_calibrate_color_options(CLI::App& app, CalibrateColorOptions& o);

}  // namespace raystage
