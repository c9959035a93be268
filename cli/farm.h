// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>

#include "cli/command.h"

namespace raystage {

/// A subcommand of `raystage farm`: its options and body.
struct FarmCommand {
  CLI::App* app = nullptr;
  CommandBody body;
};

FarmCommand declare_farm_submit(CLI::App& farm);
FarmCommand declare_farm_export(CLI::App& farm);
FarmCommand declare_farm_status(CLI::App& farm);
FarmCommand declare_farm_retry(CLI::App& farm);
FarmCommand declare_farm_cancel(CLI::App& farm);
FarmCommand declare_farm_logs(CLI::App& farm);
FarmCommand declare_farm_doctor(CLI::App& farm);
FarmCommand declare_farm_estimate(CLI::App& farm);
FarmCommand declare_farm_task(CLI::App& farm);

/// Prints to standard output; run_command() reports write errors.
inline void print(const std::string& text) { std::fputs(text.c_str(), stdout); }

/// Adds the positional JOB.
inline void add_job_argument(CLI::App& app, std::string& job) {
  app.add_option("JOB", job,
                 "job folder (OUT/NAME.farm/job-0001), or the output (OUT/NAME.####.exr) for its "
                 "newest job")
      ->required();
}

}  // namespace raystage
