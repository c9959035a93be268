// SPDX-License-Identifier: Apache-2.0
// The parts of `raystage calibrate`.
#pragma once

#include <CLI/CLI.hpp>

#include "cli/command.h"

namespace raystage {

/// A subcommand of `raystage calibrate` with its options and body. The body refers to options,
/// which must outlive it.
struct CalibrateCommand {
  CLI::App* app = nullptr;
  CommandBody body;
};

CalibrateCommand declare_calibrate_lens(CLI::App& calibrate);
CalibrateCommand declare_calibrate_geometry(CLI::App& calibrate);
CalibrateCommand declare_calibrate_color(CLI::App& calibrate);
CalibrateCommand declare_calibrate_compare(CLI::App& calibrate);

}  // namespace raystage
