// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <stop_token>
#include <string>

#include "cli/command.h"

namespace raystage::cli {

class CommandLine;

/// Options of `raystage verify --catalogue`.
struct CatalogueCommandOptions {
  std::filesystem::path folder;  ///< empty: one take is verified
  std::filesystem::path file;
  double due_days = 90;
  double limit_mbps = 0;
  bool only_reports = false, forgets_missing = false;
};

void add_catalogue_options(CommandLine& command, CatalogueCommandOptions& options);

/// Checks the takes below a folder that are due. `json`: file for the result, "-": stdout, empty:
/// none.
ExitCode verify_catalogue(const CatalogueCommandOptions& options, const std::string& json,
                          bool quiet, const std::stop_token& stop);

}  // namespace raystage::cli
