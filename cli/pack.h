// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stop_token>
#include <string>

#include "base/error.h"
#include "cli/command_line.h"
#include "store/packing/pack_take.h"

namespace raystage::cli {

/// Options that `raystage pack` and `raystage unpack` have in common.
struct PackCommandOptions {
  std::string take, output;
  store::PackOptions how;
  int threads = 0;
  bool json = false, quiet = false;
};

void add_pack_options(CommandLine& command, PackCommandOptions& options);

/// Runs pack_take() or unpack_take() and prints its report.
ExitCode run_pack(const PackCommandOptions& options, bool unpack, const std::stop_token& stop);

}  // namespace raystage::cli
