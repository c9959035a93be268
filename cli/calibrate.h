// SPDX-License-Identifier: Apache-2.0
// The parts of `raystage calibrate`.
#pragma once

#include <CLI/CLI.hpp>

#include "cli/command.h"

namespace raystage {

/// One way to calibrate: a subcommand with its options, and what runs it. The body refers to
/// options that live as long as it.
struct CalibrateCommand {
  CLI::App* app = nullptr;
  CommandBody body;
};

CalibrateCommand declare_calibrate_lens(CLI::App& calibrate);
CalibrateCommand declare_calibrate_geometry(CLI::App& calibrate);
CalibrateCommand declare_calibrate_color(CLI::App& calibrate);
CalibrateCommand declare_calibrate_compare(CLI::App& calibrate);

}  // namespace raystage
